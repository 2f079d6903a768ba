//! Which frames a sample was measured in.

/// A set of frames, by what its samples have in common.
#[derive(Clone, Debug, Default)]
pub(super) struct Set {
    /// Σt, s; 0 for the empty set.
    pub(super) time: f64,
    /// Variance that the read-outs of frames and darks add, DN².
    pub(super) read: f64,
    /// Σt of frames and of darks, by which dark current counts, s.
    pub(super) dark_time: f64,
    /// Numbers of those frames whose rounding depends on the sample.
    pub(super) frames: Vec<u16>,
}

/// The sets that occur, by number; 0 is the empty one.
///
/// A bright pixel leaves the exposures early, and the rest stays to the end: all pixels of a
/// picture share a few sets, whose number takes half of the memory that the sum of their
/// exposure times would.
#[derive(Clone, Debug)]
pub(super) struct Sets {
    list: Vec<Set>,
    /// Numbers that no sample has any more.
    free: Vec<u16>,
}

/// What a pass over one frame needs to know of the sets.
pub(super) struct Tables {
    /// 1/Σt of each set, 1/s; 0 for the empty one.
    pub(super) per_time: Vec<f32>,
    /// The set with the frame on top.
    pub(super) with_frame: Vec<u16>,
}

impl Tables {
    /// How many numbers there are.
    pub(super) fn len(&self) -> usize {
        self.per_time.len()
    }
}

impl Sets {
    pub(super) fn new() -> Self {
        Self {
            list: vec![Set::default()],
            free: vec![],
        }
    }

    pub(super) fn list(&self) -> &[Set] {
        &self.list
    }

    /// Gives each set that occurs a number for itself with `frame` on top.
    ///
    /// Where 65536 numbers are not enough, which takes as many sets, a set is its own
    /// successor: its samples then go without the frame.
    pub(super) fn extend(&mut self, frame: &Set) -> Tables {
        let count = self.list.len();
        let mut with_frame: Vec<u16> = (0..count).map(|number| number as u16).collect();
        let unused: Vec<bool> = {
            let mut unused = vec![false; count];
            for number in &self.free {
                unused[usize::from(*number)] = true;
            }
            unused
        };
        for number in (0..count).filter(|number| !unused[*number]) {
            let Some(next) = self.free.pop().or_else(|| {
                let next = u16::try_from(self.list.len()).ok()?;
                self.list.push(Set::default());
                Some(next)
            }) else {
                break;
            };
            let set = &self.list[number];
            self.list[usize::from(next)] = Set {
                time: set.time + frame.time,
                read: set.read + frame.read,
                dark_time: set.dark_time + frame.dark_time,
                frames: [&set.frames[..], &frame.frames].concat(),
            };
            with_frame[number] = next;
        }
        with_frame.extend((count..self.list.len()).map(|number| number as u16));
        let per_time = self.list.iter().map(|set| {
            if set.time > 0.0 {
                (1.0 / set.time) as f32
            } else {
                0.0
            }
        });
        Tables {
            per_time: per_time.collect(),
            with_frame,
        }
    }

    /// Lets go of the sets that no sample has; `counts[number]` is how many do.
    pub(super) fn retain(&mut self, counts: &[u64]) {
        self.free = (1..self.list.len())
            .rev()
            .filter(|number| counts[*number] == 0)
            .map(|number| number as u16)
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_used_again() {
        let mut sets = Sets::new();
        let frame = |time| Set {
            time,
            read: 1.0,
            dark_time: 2.0 * time,
            frames: vec![time as u16],
        };
        let first = sets.extend(&frame(1.0));
        assert_eq!((first.with_frame[0], first.per_time[1]), (1, 1.0));
        sets.retain(&[5, 5]);
        let second = sets.extend(&frame(3.0));
        let [empty, both] = [second.with_frame[0], second.with_frame[1]];
        assert_eq!((empty, both), (2, 3));
        assert_eq!(sets.list()[3].time, 4.0);
        assert_eq!(sets.list()[3].dark_time, 8.0);
        assert_eq!(sets.list()[3].frames, [1, 3]);
        // Nobody is left with the first frame alone.
        sets.retain(&[5, 0, 5, 5]);
        let third = sets.extend(&frame(8.0));
        assert!(third.with_frame.contains(&1), "{:?}", third.with_frame);
        assert_eq!(third.len(), sets.list().len());
    }

    #[test]
    fn with_every_number_taken_frames_are_left_out() {
        let mut sets = Sets::new();
        let frame = Set {
            time: 1.0,
            ..Set::default()
        };
        for doubling in 0..16 {
            let tables = sets.extend(&frame);
            assert_eq!(tables.len(), 2 << doubling);
            sets.retain(&vec![1; tables.len()]);
        }
        let full = sets.extend(&frame);
        assert_eq!(full.len(), 1 << 16);
        assert!((0..=u16::MAX).all(|n| full.with_frame[usize::from(n)] == n));
    }
}
