//! libfreenect's C interface, loaded when it is needed. All that is unsafe here is in this folder.
//!
//! Declarations follow libfreenect.h and libfreenect_registration.h of 0.5. Callbacks run on the
//! thread that calls [`Device::process_events`], and cannot unwind into C: `extern "C"` aborts.

mod abi;
mod mailbox;

use std::ffi::{CStr, c_int};
use std::path::Path;
use std::ptr;

use libloading::Library;

pub use abi::ZeroPlane;
use abi::{Functions, Handle, TimeValue};
pub use mailbox::{complaint, depth, infrared};
use mailbox::{on_depth, on_log, on_video};

pub const WIDTH: usize = 640;
pub const HEIGHT: usize = 480;
pub const DEPTH_BYTES: usize = 2 * WIDTH * HEIGHT;
/// An infrared picture has eight rows more than the depth.
pub const INFRARED_HEIGHT: usize = 488;
pub const INFRARED_BYTES: usize = 2 * WIDTH * INFRARED_HEIGHT;

const RESOLUTION_MEDIUM: c_int = 1;
const DEPTH_11BIT: c_int = 0;
const VIDEO_IR_10BIT: c_int = 3;
/// Cameras only: a motor that is missing or claimed by others must not stop us.
const SUBDEVICE_CAMERA: c_int = 2;
const LOG_ERROR: c_int = 1;

/// A loaded library with a context.
pub struct Freenect {
    functions: Functions,
    context: Handle,
    /// Last: the functions point into it.
    _library: Library,
}

impl Freenect {
    /// Load the library and initialise it. `check` sees, before anything is called, whether it is
    /// the stand-in.
    pub fn load(
        path: &Path,
        check: impl FnOnce(bool) -> Result<(), String>,
    ) -> Result<Self, String> {
        // SAFETY: loading runs the library's initialisers; libfreenect and libusb have harmless ones.
        let library = unsafe { Library::new(path) }.map_err(|e| e.to_string())?;
        let functions = Functions::of(&library)?;
        check(functions.list.is_none())?;
        mailbox::empty();
        let mut context = ptr::null_mut();
        // SAFETY: as libfreenect.h asks; a null USB context makes it open its own.
        if unsafe { (functions.init)(&raw mut context, ptr::null_mut()) } < 0 {
            return Err("freenect_init failed: no access to USB".into());
        }
        // SAFETY: the context is initialised.
        unsafe {
            (functions.set_log_level)(context, LOG_ERROR);
            (functions.set_log_callback)(context, on_log);
            if let Some(select) = functions.select_subdevices {
                select(context, SUBDEVICE_CAMERA);
            }
        }
        Ok(Freenect { functions, context, _library: library })
    }

    /// Number of sensors; negative when USB cannot be asked.
    pub fn devices(&self) -> i32 {
        // SAFETY: the context lives as long as self.
        unsafe { (self.functions.devices)(self.context) }
    }

    /// The sensors' serials; `None` when the library cannot tell.
    pub fn serials(&self) -> Option<Vec<String>> {
        let (list, free) = (self.functions.list?, self.functions.free_list?);
        let mut first = ptr::null_mut();
        let mut serials = Vec::new();
        // SAFETY: the list is walked while it lives and freed once.
        unsafe {
            if list(self.context, &raw mut first) < 0 {
                return None;
            }
            let mut item = first;
            while !item.is_null() {
                let serial = (*item).serial;
                let named = !serial.is_null();
                serials.push(if named {
                    CStr::from_ptr(serial).to_string_lossy().into()
                } else {
                    String::new()
                });
                item = (*item).next;
            }
            free(first);
        }
        Some(serials)
    }

    /// Open a sensor, by its serial or the first.
    pub fn open(self, serial: Option<&CStr>) -> Result<Device, i32> {
        let mut device = ptr::null_mut();
        let (f, context) = (&self.functions, self.context);
        // SAFETY: the context lives, and the serial is a C string.
        let code = unsafe {
            match serial {
                Some(serial) => (f.open_serial)(context, &raw mut device, serial.as_ptr()),
                None => (f.open)(context, &raw mut device, 0),
            }
        };
        if code < 0 || device.is_null() { Err(code) } else { Ok(Device { freenect: self, device }) }
    }
}

impl Drop for Freenect {
    fn drop(&mut self) {
        // SAFETY: shut down once, after every device (a device owns the context it came from).
        unsafe { (self.functions.shutdown)(self.context) };
    }
}

/// An open sensor.
pub struct Device {
    freenect: Freenect,
    device: Handle,
}

impl Device {
    /// Start depth in 11-bit words, unpacked to 16.
    pub fn start_depth(&self) -> Result<(), String> {
        let f = &self.freenect.functions;
        // SAFETY: the device is open.
        unsafe {
            let mode = (f.find_depth_mode)(RESOLUTION_MEDIUM, DEPTH_11BIT);
            if mode.is_valid == 0 || mode.bytes != DEPTH_BYTES as i32 {
                return Err("it has no 11-bit depth of 640 x 480 px".into());
            }
            (f.set_depth_callback)(self.device, on_depth);
            if (f.set_depth_mode)(self.device, mode) < 0 || (f.start_depth)(self.device) < 0 {
                return Err("depth cannot be started".into());
            }
        }
        Ok(())
    }

    /// Start 10-bit infrared; false when the sensor will not.
    pub fn start_infrared(&self) -> bool {
        let f = &self.freenect.functions;
        // SAFETY: the device is open.
        unsafe {
            let mode = (f.find_video_mode)(RESOLUTION_MEDIUM, VIDEO_IR_10BIT);
            if mode.is_valid == 0 || mode.bytes != INFRARED_BYTES as i32 {
                return false;
            }
            (f.set_video_callback)(self.device, on_video);
            (f.set_video_mode)(self.device, mode) >= 0 && (f.start_video)(self.device) >= 0
        }
    }

    /// What the factory measured on this unit: its reference plane and shift.
    pub fn zero_plane(&self) -> Option<(ZeroPlane, f64)> {
        let f = &self.freenect.functions;
        let (copy, destroy) = (f.copy_registration?, f.destroy_registration?);
        // SAFETY: the copy's tables are freed by its own function.
        unsafe {
            let mut registration = copy(self.device);
            let found = (registration.zero_plane, registration.const_shift);
            destroy(&raw mut registration);
            Some(found)
        }
    }

    /// Let the library work for at most 0.1 s; negative when the sensor is gone.
    pub fn process_events(&self) -> i32 {
        let mut wait = TimeValue { seconds: 0, microseconds: 100_000 };
        // SAFETY: the context lives.
        unsafe { (self.freenect.functions.process)(self.freenect.context, &raw mut wait) }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let f = &self.freenect.functions;
        // SAFETY: stopping what was not started is an error code that nobody needs.
        unsafe {
            (f.stop_depth)(self.device);
            (f.stop_video)(self.device);
            (f.close)(self.device);
        }
    }
}
