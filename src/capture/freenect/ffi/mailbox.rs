//! What the callbacks bring, kept for the thread that called the library.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::time::SystemTime;

use super::abi::Handle;
use super::{DEPTH_BYTES, INFRARED_BYTES, LOG_ERROR};

thread_local! {
    static MAILBOX: RefCell<Mailbox> = RefCell::default();
}

/// What the callbacks of this thread have brought.
#[derive(Default)]
struct Mailbox {
    depth: VecDeque<(SystemTime, Vec<u8>)>,
    infrared: Option<Vec<u8>>,
    log: String,
}

fn deliver(put: impl FnOnce(&mut Mailbox)) {
    let _ = MAILBOX.try_with(|mailbox| {
        if let Ok(mut mailbox) = mailbox.try_borrow_mut() {
            put(&mut mailbox);
        }
    });
}

/// # Safety
/// `pixels` must be null or point at `bytes` readable bytes; it need not be aligned.
unsafe fn copied(pixels: *const c_void, bytes: usize) -> Option<Vec<u8>> {
    // SAFETY: the caller's promise.
    (!pixels.is_null())
        .then(|| unsafe { std::slice::from_raw_parts(pixels.cast::<u8>(), bytes) }.to_vec())
}

pub(super) extern "C" fn on_depth(_: Handle, pixels: *mut c_void, _ticks: u32) {
    // SAFETY: the mode that was set has this many bytes a frame.
    if let Some(bytes) = unsafe { copied(pixels, DEPTH_BYTES) } {
        deliver(|mailbox| mailbox.depth.push_back((SystemTime::now(), bytes)));
    }
}

pub(super) extern "C" fn on_video(_: Handle, pixels: *mut c_void, _ticks: u32) {
    // SAFETY: as above; video is started in the 10-bit infrared mode only.
    let bytes = unsafe { copied(pixels, INFRARED_BYTES) };
    deliver(|mailbox| mailbox.infrared = bytes);
}

pub(super) extern "C" fn on_log(_: Handle, level: c_int, message: *const c_char) {
    if level <= LOG_ERROR && !message.is_null() {
        // SAFETY: libfreenect hands over a C string.
        let text = unsafe { CStr::from_ptr(message) }.to_string_lossy();
        deliver(|mailbox| mailbox.log = text.trim().to_string());
    }
}

/// The library's last complaint, which is taken away.
pub fn complaint() -> String {
    MAILBOX.with_borrow_mut(|mailbox| std::mem::take(&mut mailbox.log))
}

/// The oldest depth frame that waits, with the time it came.
pub fn depth() -> Option<(SystemTime, Vec<u8>)> {
    MAILBOX.with_borrow_mut(|mailbox| mailbox.depth.pop_front())
}

/// The newest infrared picture since the last one was taken.
pub fn infrared() -> Option<Vec<u8>> {
    MAILBOX.with_borrow_mut(|mailbox| mailbox.infrared.take())
}

/// Nothing that an earlier library brought.
pub(super) fn empty() {
    MAILBOX.with_borrow_mut(|mailbox| *mailbox = Mailbox::default());
}
