//! The terminal while capturing: single keys, a screen of its own, and the way back from both.

use std::collections::VecDeque;
use std::io::{IsTerminal, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use kinoise::capture::{Line, Style};

/// A signal has come that ends the capture in order.
static STOP: AtomicBool = AtomicBool::new(false);

/// Has Ctrl-C (or a hang-up, or a polite kill) come?
pub fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// Can a person read the screen and press keys?
pub fn is_interactive() -> bool {
    cfg!(unix) && std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

#[cfg(unix)]
mod system {
    //! termios and signals: the C library's, as std has neither.

    use super::{Ordering, STOP};

    extern "C" fn stop(_: libc::c_int) {
        STOP.store(true, Ordering::Relaxed);
    }

    /// Signals that ask to end set a flag; a file that grows too large is an error, not death.
    pub fn heed_signals() {
        let handler: extern "C" fn(libc::c_int) = stop;
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
            // SAFETY: the handler stores into an atomic, which is async-signal-safe.
            unsafe { libc::signal(signal, handler as *const () as libc::sighandler_t) };
        }
        // SAFETY: to ignore a signal needs no handler.
        unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    }

    /// Keys come one by one and unseen, until dropped. Ctrl-C stays a signal.
    pub struct SingleKeys(libc::termios);

    impl SingleKeys {
        pub fn new() -> Option<Self> {
            let mut before = std::mem::MaybeUninit::<libc::termios>::uninit();
            // SAFETY: tcgetattr fills the structure when it returns 0.
            let before = unsafe {
                if libc::tcgetattr(libc::STDIN_FILENO, before.as_mut_ptr()) != 0 {
                    return None;
                }
                before.assume_init()
            };
            let mut keys = before;
            keys.c_lflag &= !(libc::ICANON | libc::ECHO);
            // A read returns at once, with a key or without.
            keys.c_cc[libc::VMIN] = 0;
            keys.c_cc[libc::VTIME] = 0;
            // A screen that is stopped half-way (Ctrl-Z) would leave the terminal as it is.
            keys.c_cc[libc::VSUSP] = libc::_POSIX_VDISABLE;
            // SAFETY: the structure came from tcgetattr.
            unsafe { libc::tcsetattr(libc::STDIN_FILENO, libc::TCSANOW, &raw const keys) };
            Some(SingleKeys(before))
        }
    }

    impl Drop for SingleKeys {
        fn drop(&mut self) {
            // SAFETY: as it was.
            unsafe { libc::tcsetattr(libc::STDIN_FILENO, libc::TCSANOW, &raw const self.0) };
        }
    }

    /// Columns and rows.
    pub fn size() -> Option<(usize, usize)> {
        let mut size = libc::winsize { ws_row: 0, ws_col: 0, ws_xpixel: 0, ws_ypixel: 0 };
        // SAFETY: the request fills a winsize.
        let code = unsafe { libc::ioctl(libc::STDERR_FILENO, libc::TIOCGWINSZ, &raw mut size) };
        (code == 0 && size.ws_col > 0).then_some((size.ws_col.into(), size.ws_row.into()))
    }
}

#[cfg(not(unix))]
mod system {
    //! Without termios there is no screen, only lines.

    pub fn heed_signals() {}

    pub struct SingleKeys;

    impl SingleKeys {
        pub fn new() -> Option<Self> {
            None
        }
    }

    pub fn size() -> Option<(usize, usize)> {
        None
    }
}

pub use system::heed_signals;

const ENTER: &str = "\x1b[?1049h\x1b[?25l\x1b[2J";
const LEAVE: &str = "\x1b[0m\x1b[?25h\x1b[?1049l";
const ESCAPE: u8 = 0x1b;
/// What the oldest terminals have.
const USUAL: (usize, usize) = (80, 24);

/// The terminal's other screen, until dropped.
pub struct Terminal {
    _keys: system::SingleKeys,
    pressed: VecDeque<char>,
}

impl Terminal {
    /// `None` when the terminal will not.
    pub fn take() -> Option<Self> {
        let keys = system::SingleKeys::new()?;
        write(ENTER);
        Some(Terminal { _keys: keys, pressed: VecDeque::new() })
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        system::size().unwrap_or(USUAL)
    }

    /// Draw over what stands there.
    pub fn draw(&self, lines: &[Line], bell: bool) {
        let mut text = String::from("\x1b[H");
        for (i, line) in lines.iter().enumerate() {
            let style = match line.style {
                Style::Plain => "\x1b[0m",
                Style::Loud => "\x1b[0;1;33m",
                Style::Flash => "\x1b[0;1;7;32m",
            };
            // The rest of the line in the same style: a flash fills the screen.
            text += &format!("\x1b[{};1H{style}{}\x1b[K", i + 1, line.text);
        }
        text += "\x1b[0m\x1b[J";
        if bell {
            text.push('\x07');
        }
        write(&text);
    }

    /// A key that was pressed, in small letters.
    pub fn key(&mut self) -> Option<char> {
        if self.pressed.is_empty() {
            let mut bytes = [0; 64];
            let read = std::io::stdin().lock().read(&mut bytes).unwrap_or(0);
            self.pressed.extend(letters(&bytes[..read]));
        }
        self.pressed.pop_front()
    }
}

/// Function and arrow keys send escape sequences with letters in them (F3: ESC O R): these are
/// no letters.
fn letters(bytes: &[u8]) -> Vec<char> {
    let mut letters = Vec::new();
    let mut bytes = bytes.iter();
    while let Some(&byte) = bytes.next() {
        if byte != ESCAPE {
            letters.push(char::from(byte).to_ascii_lowercase());
            continue;
        }
        match bytes.next() {
            Some(b'O') => _ = bytes.next(),
            Some(b'[') => _ = bytes.find(|b| (0x40..=0x7e).contains(*b)),
            _ => {}
        }
    }
    letters
}

impl Drop for Terminal {
    fn drop(&mut self) {
        write(LEAVE);
    }
}

/// A terminal that is gone is no reason to stop taking views.
fn write(text: &str) {
    let mut err = std::io::stderr().lock();
    let _ = err.write_all(text.as_bytes()).and_then(|()| err.flush());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_letters_are_letters() {
        assert_eq!(letters(b"R"), ['r']);
        // F2, F3, up, F5, Alt-q, then a key.
        assert!(letters(b"\x1bOQ\x1bOR\x1b[A\x1b[15~\x1bq").is_empty());
        assert_eq!(letters(b"s\x1bOSq"), ['s', 'q']);
        assert!(letters(b"\x1b").is_empty() && letters(b"").is_empty());
    }
}
