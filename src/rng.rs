//! Randomness is an argument: one [`Seed`] opens any number of independent, named streams.
//!
//! A stream depends on the seed and on its own name only, so adding a consumer, or running the
//! consumers on more threads, changes no other stream.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// The generator every stream uses: portable, so a seed gives the same bytes on every machine.
pub type Stream = ChaCha8Rng;

/// The seed of a whole run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seed(pub u64);

impl Seed {
    /// The stream called `name`: independent of every stream with another name.
    ///
    /// ```
    /// use kinoise::rng::Seed;
    /// use rand::Rng;
    /// let draw = |name| Seed(7).stream(name).random::<u64>();
    /// assert_eq!(draw("ransac/0001"), draw("ransac/0001"));
    /// assert_ne!(draw("ransac/0001"), draw("ransac/0002"));
    /// ```
    pub fn stream(self, name: &str) -> Stream {
        let mut hash = Sha256::new();
        hash.update(self.0.to_le_bytes());
        hash.update(name.as_bytes());
        ChaCha8Rng::from_seed(hash.finalize().into())
    }
}
