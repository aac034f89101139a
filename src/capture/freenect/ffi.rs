//! libfreenect's C interface, loaded on demand. All unsafe code of this program is in this file, and its
//! public interface cannot be misused:
//!
//! - Declarations follow libfreenect.h and libfreenect_registration.h of 0.5; the user must make sure that
//!   the loaded file conforms to them.
//! - The library is [`Loaded`], then started ([`Freenect`]), then has an open [`Device`]: each owns the one
//!   before, so that no call meets a null handle, and all are closed in reverse order.
//! - Handles are pointers, so these types stay on their thread. Callbacks run on the thread that
//!   calls [`Device::process_events`], and cannot unwind into C: `extern "C"` aborts.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_long, c_void};
use std::path::Path;
use std::ptr;
use std::time::SystemTime;

use libloading::Library;

pub const WIDTH: usize = 640;
pub const HEIGHT: usize = 480;
pub const DEPTH_BYTES: usize = 2 * WIDTH * HEIGHT;
/// Infrared images have eight more rows than depth images.
pub const INFRARED_HEIGHT: usize = 488;
pub const INFRARED_BYTES: usize = 2 * WIDTH * INFRARED_HEIGHT;

const RESOLUTION_MEDIUM: c_int = 1;
const DEPTH_11BIT: c_int = 0;
const VIDEO_IR_10BIT: c_int = 3;
/// Cameras only: a motor that is missing or in use must not stop us.
const SUBDEVICE_CAMERA: c_int = 2;
const LOG_ERROR: c_int = 1;

#[repr(C)]
#[derive(Clone, Copy)]
struct FrameMode {
    reserved: u32,
    resolution: c_int,
    format: i32,
    bytes: i32,
    width: i16,
    height: i16,
    data_bits: i8,
    padding_bits: i8,
    rate: i8,
    is_valid: i8,
}

impl FrameMode {
    fn has(&self, bytes: usize) -> bool {
        self.is_valid != 0 && self.bytes == bytes as i32
    }
}

/// Reference plane of a unit; lengths in cm (against the header's comments, but
/// according to its own conversion to mm).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroPlane {
    pub emitter_distance: f32,
    pub colour_distance: f32,
    pub reference_distance: f32,
    pub reference_pixel_size: f32,
}

#[repr(C)]
struct Registration {
    info: [i32; 29],
    padding: [u16; 3],
    zero_plane: ZeroPlane,
    const_shift: f64,
    tables: [*mut c_void; 3],
}

#[repr(C)]
struct Attributes {
    next: *mut Attributes,
    serial: *const c_char,
}

#[repr(C)]
struct TimeValue {
    seconds: c_long,
    microseconds: c_long,
}

type Handle = *mut c_void;
type FrameCallback = extern "C" fn(Handle, *mut c_void, u32);
type LogCallback = extern "C" fn(Handle, c_int, *const c_char);
type Plain = unsafe extern "C" fn(Handle) -> c_int;
type FindMode = unsafe extern "C" fn(c_int, c_int) -> FrameMode;
type SetMode = unsafe extern "C" fn(Handle, FrameMode) -> c_int;
type SetCallback = unsafe extern "C" fn(Handle, FrameCallback);

/// Declares the functions by their C names without "freenect_", and looks them up in a library.
macro_rules! functions {
    (required { $($name:ident: $type:ty;)* } optional { $($optional:ident: $optional_type:ty;)* }) => {
        struct Functions {
            $($name: $type,)*
            $($optional: Option<$optional_type>,)*
        }

        impl Functions {
            fn of(library: &Library) -> Result<Self, String> {
                // SAFETY: every type is transcribed from the headers named above, and a pointer is
                // used only while the library is loaded.
                unsafe {
                    Ok(Functions {
                        $($name: find(library, concat!("freenect_", stringify!($name)))?,)*
                        $($optional: find(library, concat!("freenect_", stringify!($optional))).ok(),)*
                    })
                }
            }
        }
    };
}

/// # Safety
/// `T` must be the type of a pointer to the C function.
unsafe fn find<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
    // SAFETY: the caller's promise.
    unsafe { library.get::<T>(name.as_bytes()) }
        .map(|f| *f)
        .map_err(|_| format!("it has no {name}"))
}

functions! {
    required {
        init: unsafe extern "C" fn(*mut Handle, Handle) -> c_int;
        shutdown: Plain;
        set_log_level: unsafe extern "C" fn(Handle, c_int);
        set_log_callback: unsafe extern "C" fn(Handle, LogCallback);
        num_devices: Plain;
        open_device: unsafe extern "C" fn(Handle, *mut Handle, c_int) -> c_int;
        open_device_by_camera_serial:
            unsafe extern "C" fn(Handle, *mut Handle, *const c_char) -> c_int;
        close_device: Plain;
        find_depth_mode: FindMode;
        set_depth_mode: SetMode;
        set_depth_callback: SetCallback;
        start_depth: Plain;
        stop_depth: Plain;
        find_video_mode: FindMode;
        set_video_mode: SetMode;
        set_video_callback: SetCallback;
        start_video: Plain;
        stop_video: Plain;
        process_events_timeout: unsafe extern "C" fn(Handle, *mut TimeValue) -> c_int;
    }
    optional {
        select_subdevices: unsafe extern "C" fn(Handle, c_int);
        list_device_attributes: unsafe extern "C" fn(Handle, *mut *mut Attributes) -> c_int;
        free_device_attributes: unsafe extern "C" fn(*mut Attributes);
        copy_registration: unsafe extern "C" fn(Handle) -> Registration;
        destroy_registration: unsafe extern "C" fn(*mut Registration) -> c_int;
    }
}

thread_local! {
    static MAILBOX: RefCell<Mailbox> = RefCell::default();
}

/// What the callbacks have delivered to the thread that called the library.
#[derive(Default)]
pub struct Mailbox {
    /// Depth frames with their arrival times, oldest first.
    pub depth: VecDeque<(SystemTime, Vec<u8>)>,
    /// The latest infrared image.
    pub infrared: Option<Vec<u8>>,
    /// The library's last error message.
    pub log: String,
}

/// Accesses this thread's mailbox.
pub fn mailbox<T>(with: impl FnOnce(&mut Mailbox) -> T) -> T {
    MAILBOX.with_borrow_mut(with)
}

/// # Safety
/// `pixels` must be null or point at `bytes` readable bytes; it need not be aligned.
unsafe fn copied(pixels: *const c_void, bytes: usize) -> Option<Vec<u8>> {
    // SAFETY: the caller's promise.
    (!pixels.is_null())
        .then(|| unsafe { std::slice::from_raw_parts(pixels.cast::<u8>(), bytes) }.to_vec())
}

extern "C" fn on_depth(_: Handle, pixels: *mut c_void, _ticks: u32) {
    // SAFETY: the mode that was set has this many bytes per frame.
    let bytes = unsafe { copied(pixels, DEPTH_BYTES) };
    mailbox(|mail| mail.depth.extend(bytes.map(|bytes| (SystemTime::now(), bytes))));
}

extern "C" fn on_video(_: Handle, pixels: *mut c_void, _ticks: u32) {
    // SAFETY: as above; video is started in the 10-bit infrared mode only.
    let bytes = unsafe { copied(pixels, INFRARED_BYTES) };
    mailbox(|mail| mail.infrared = bytes);
}

extern "C" fn on_log(_: Handle, level: c_int, message: *const c_char) {
    if level <= LOG_ERROR && !message.is_null() {
        // SAFETY: libfreenect hands over a C string.
        let text = unsafe { CStr::from_ptr(message) }.to_string_lossy();
        mailbox(|mail| mail.log = text.trim().to_string());
    }
}

/// The loaded library, not yet started.
pub struct Loaded {
    functions: Functions,
    /// Dropped last: the functions point into it.
    _library: Library,
}

/// The started library.
pub struct Freenect {
    /// Never null.
    context: Handle,
    loaded: Loaded,
}

/// An open sensor.
pub struct Device {
    /// Never null.
    device: Handle,
    library: Freenect,
}

impl Loaded {
    /// Loads the library and looks up its functions.
    pub fn load(path: &Path) -> Result<Self, String> {
        // SAFETY: loading runs the library's initialisers; libfreenect and libusb have harmless ones.
        let library = unsafe { Library::new(path) }.map_err(|e| e.to_string())?;
        let functions = Functions::of(&library)?;
        Ok(Loaded { functions, _library: library })
    }

    /// Whether it is fakenect, which plays a dump and cannot list devices.
    pub fn is_stand_in(&self) -> bool {
        self.functions.list_device_attributes.is_none()
    }

    pub fn start(self) -> Result<Freenect, String> {
        // Discards what an earlier library left.
        MAILBOX.take();
        let f = &self.functions;
        let mut context = ptr::null_mut();
        // SAFETY: as libfreenect.h asks; a null USB context makes it open its own.
        unsafe {
            if (f.init)(&raw mut context, ptr::null_mut()) < 0 || context.is_null() {
                return Err("freenect_init failed: no access to USB".into());
            }
            (f.set_log_level)(context, LOG_ERROR);
            (f.set_log_callback)(context, on_log);
            if let Some(select) = f.select_subdevices {
                select(context, SUBDEVICE_CAMERA);
            }
        }
        Ok(Freenect { context, loaded: self })
    }
}

impl Freenect {
    /// Number of sensors; negative if USB is not accessible.
    pub fn devices(&self) -> i32 {
        // SAFETY: the library is started.
        unsafe { (self.loaded.functions.num_devices)(self.context) }
    }

    /// The sensors' serial numbers; `None` if the library cannot list them.
    pub fn serials(&self) -> Option<Vec<String>> {
        let f = &self.loaded.functions;
        let (list, free) = (f.list_device_attributes?, f.free_device_attributes?);
        let mut first = ptr::null_mut();
        let mut serials = Vec::new();
        // SAFETY: the list is walked while it lives and freed once.
        unsafe {
            if list(self.context, &raw mut first) < 0 {
                return None;
            }
            let mut item = first;
            while let Some(Attributes { next, serial }) = item.as_ref() {
                let text = (!serial.is_null()).then(|| CStr::from_ptr(*serial).to_string_lossy());
                serials.push(text.unwrap_or_default().into_owned());
                item = *next;
            }
            free(first);
        }
        Some(serials)
    }

    /// Opens a sensor by its serial number, or the first one.
    pub fn open(self, serial: Option<&CStr>) -> Result<Device, i32> {
        let f = &self.loaded.functions;
        let mut device = ptr::null_mut();
        // SAFETY: the library is started, and the serial is a C string.
        let code = unsafe {
            match serial {
                Some(s) => {
                    (f.open_device_by_camera_serial)(self.context, &raw mut device, s.as_ptr())
                }
                None => (f.open_device)(self.context, &raw mut device, 0),
            }
        };
        if code < 0 || device.is_null() { Err(code) } else { Ok(Device { device, library: self }) }
    }
}

impl Device {
    /// Starts depth in 11-bit words, unpacked to 16.
    pub fn start_depth(&self) -> Result<(), &'static str> {
        let f = self.functions();
        // SAFETY: the device is open.
        unsafe {
            let mode = (f.find_depth_mode)(RESOLUTION_MEDIUM, DEPTH_11BIT);
            if !mode.has(DEPTH_BYTES) {
                return Err("it has no 11-bit depth of 640 x 480 px");
            }
            (f.set_depth_callback)(self.device, on_depth);
            let started =
                (f.set_depth_mode)(self.device, mode) >= 0 && (f.start_depth)(self.device) >= 0;
            if started { Ok(()) } else { Err("depth cannot be started") }
        }
    }

    /// Starts 10-bit infrared; false if that fails.
    pub fn start_infrared(&self) -> bool {
        let f = self.functions();
        // SAFETY: the device is open.
        unsafe {
            let mode = (f.find_video_mode)(RESOLUTION_MEDIUM, VIDEO_IR_10BIT);
            (f.set_video_callback)(self.device, on_video);
            mode.has(INFRARED_BYTES)
                && (f.set_video_mode)(self.device, mode) >= 0
                && (f.start_video)(self.device) >= 0
        }
    }

    /// Factory calibration of this unit: its reference plane and shift.
    pub fn zero_plane(&self) -> Option<(ZeroPlane, f64)> {
        let f = self.functions();
        let (copy, destroy) = (f.copy_registration?, f.destroy_registration?);
        // SAFETY: the device is open, and the copy's tables are freed by its own function.
        unsafe {
            let mut registration = copy(self.device);
            let found = (registration.zero_plane, registration.const_shift);
            destroy(&raw mut registration);
            Some(found)
        }
    }

    /// Lets the library work for at most 0.1 s; negative if the sensor is gone.
    pub fn process_events(&self) -> i32 {
        let mut wait = TimeValue { seconds: 0, microseconds: 100_000 };
        // SAFETY: the library is started.
        unsafe { (self.functions().process_events_timeout)(self.library.context, &raw mut wait) }
    }

    fn functions(&self) -> &Functions {
        &self.library.loaded.functions
    }
}

impl Drop for Freenect {
    fn drop(&mut self) {
        // SAFETY: once, and after every device, which owns it.
        unsafe { (self.loaded.functions.shutdown)(self.context) };
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let f = self.functions();
        // SAFETY: once. Stopping what was not started returns an error code, which is ignored.
        unsafe {
            (f.stop_depth)(self.device);
            (f.stop_video)(self.device);
            (f.close_device)(self.device);
        }
    }
}
