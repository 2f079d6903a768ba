//! The pieces of a scattering one by one, so that a bench can say where the time goes.

use physics::lanes::{Floats, WIDTH, minus_ln, random_direction, uniform};
use physics::simd::{LaneLoop, SimdPath};

const CHUNKS: usize = 8;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// −ln of a uniform number.
    Logarithm,
    /// Sine and cosine of a random angle.
    SineAndCosine,
    /// A square root.
    SquareRoot,
    /// A division.
    Division,
}

/// As many lanes as a pool has, with random bits and results.
#[derive(Debug)]
pub struct Pieces {
    words: [[u32; WIDTH]; CHUNKS],
    out: [[f32; WIDTH]; CHUNKS],
}

impl Default for Pieces {
    fn default() -> Self {
        Self {
            words: [[0x9e37_79b9; WIDTH]; CHUNKS],
            out: [[0.0; WIDTH]; CHUNKS],
        }
    }
}

impl Pieces {
    /// How many lanes there are.
    pub const LANES: usize = CHUNKS * WIDTH;

    /// Does the piece once in every lane, on the path if the processor has it.
    pub fn pass(&mut self, piece: Piece, path: SimdPath) {
        path.run(Pass {
            piece,
            pieces: self,
        });
    }
}

struct Pass<'a> {
    piece: Piece,
    pieces: &'a mut Pieces,
}

impl LaneLoop for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (words, out) in self.pieces.words.iter().zip(&mut self.pieces.out) {
            match self.piece {
                Piece::Logarithm => each(out, words, minus_ln::<FMA>),
                Piece::SineAndCosine => each(out, words, |bits| {
                    let (cos, sin) = random_direction::<FMA>(bits);
                    cos + sin
                }),
                Piece::SquareRoot => each(out, words, |bits| uniform(bits).sqrt()),
                Piece::Division => each(out, words, |bits| 1.0 / uniform(bits)),
            }
        }
    }
}

#[inline(always)]
fn each(out: &mut Floats, words: &[u32; WIDTH], piece: impl Fn(u32) -> f32) {
    for (out, &bits) in out.iter_mut().zip(words) {
        *out = piece(bits);
    }
}
