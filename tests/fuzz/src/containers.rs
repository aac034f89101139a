//! Films in one file: ROS 1 and ROS 2 bags, MCAP, NumPy arrays.

use kinoise::io::{Assumed, open_uncut};

use super::desk::{Desk, assumed, check};

/// Checks a film if it opens; one without a camera or depth code is opened with a given one.
fn film(name: &str, data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = Desk::new(&[]);
    }
    DESK.with(|desk| {
        let path = desk.put(name, data);
        let given = assumed();
        let own = open_uncut(&path, &Assumed::default());
        let opened = own.or_else(|_| open_uncut(&path, &Assumed { code: None, ..given.clone() }));
        let Ok(recording) = opened.or_else(|_| open_uncut(&path, &given)) else { return false };
        check(&recording);
        true
    })
}

pub fn ros1(data: &[u8]) -> bool {
    film("film.bag", data)
}

pub fn mcap(data: &[u8]) -> bool {
    film("film.mcap", data)
}

pub fn db3(data: &[u8]) -> bool {
    film("film.db3", data)
}

/// .npz, and .npy where the bytes begin as such.
pub fn numpy(data: &[u8]) -> bool {
    film("film.npz", data)
}
