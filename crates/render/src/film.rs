//! Pictures that know how well they know themselves.

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// Its standard error.
    pub u: f64,
}

/// Sums over rounds of equal effort: means and standard errors of many numbers at once.
///
/// The numbers may be pixels of a picture, channel by channel, or powers through faces.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    rounds: u64,
    sums: Vec<[f64; 2]>,
}

impl Film {
    /// Nothing yet, of `len` numbers.
    pub fn new(len: usize) -> Self {
        Self {
            rounds: 0,
            sums: vec![[0.0; 2]; len],
        }
    }

    /// Adds one round.
    ///
    /// # Panics
    ///
    /// If it has not as many numbers.
    pub fn add(&mut self, round: &[f64]) {
        assert_eq!(round.len(), self.sums.len(), "a round of another film");
        self.rounds += 1;
        for (sum, x) in self.sums.iter_mut().zip(round) {
            sum[0] += x;
            sum[1] += x * x;
        }
    }

    /// How many rounds there were.
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.sums.len()
    }

    /// Whether there is no number at all.
    pub fn is_empty(&self) -> bool {
        self.sums.is_empty()
    }

    /// Mean and standard error of the number `index`; the error is infinite before two rounds.
    pub fn estimate(&self, index: usize) -> Estimate {
        let n = self.rounds as f64;
        let [sum, square] = self.sums[index];
        let value = if n > 0.0 { sum / n } else { 0.0 };
        let u = if n > 1.0 {
            ((square / n - value * value).max(0.0) / (n - 1.0)).sqrt()
        } else {
            f64::INFINITY
        };
        Estimate { value, u }
    }

    /// Root mean square of the standard errors over the mean of the values.
    pub fn relative_error(&self) -> f64 {
        let (mut values, mut squares) = (0.0, 0.0);
        for index in 0..self.len() {
            let Estimate { value, u } = self.estimate(index);
            values += value;
            squares += u * u;
        }
        let n = self.len() as f64;
        if squares == 0.0 {
            return 0.0;
        }
        (squares / n).sqrt() / (values / n).abs()
    }

    /// Rounds and sums, to go on from later.
    pub fn state(&self) -> (u64, &[[f64; 2]]) {
        (self.rounds, &self.sums)
    }

    /// The film of a [`Self::state`].
    pub fn restore(rounds: u64, sums: Vec<[f64; 2]>) -> Self {
        Self { rounds, sums }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_that_of_the_mean() {
        let mut film = Film::new(2);
        assert_eq!(film.estimate(0).u, f64::INFINITY);
        for x in [1.0, 2.0, 3.0, 4.0] {
            film.add(&[x, 5.0]);
        }
        // Sample variance 5/3, of a mean of four 5/12.
        let got = film.estimate(0);
        assert!((got.value - 2.5).abs() < 1e-15);
        assert!((got.u - (5.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        assert_eq!(film.estimate(1), Estimate { value: 5.0, u: 0.0 });
        let (rounds, sums) = film.state();
        assert_eq!(Film::restore(rounds, sums.to_vec()), film);
    }
}
