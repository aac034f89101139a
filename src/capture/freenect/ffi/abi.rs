//! What the headers declare, and the functions found in a library.

use std::ffi::{c_char, c_int, c_void};

use libloading::Library;

/// What the real library has and the stand-in has not.
const LIST: &str = "freenect_list_device_attributes";

#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct FrameMode {
    pub(super) reserved: u32,
    pub(super) resolution: c_int,
    pub(super) format: i32,
    pub(super) bytes: i32,
    pub(super) width: i16,
    pub(super) height: i16,
    pub(super) data_bits: i8,
    pub(super) padding_bits: i8,
    pub(super) rate: i8,
    pub(super) is_valid: i8,
}

/// A unit's reference plane: lengths in cm (the header's comments say otherwise; its own
/// conversion to mm says so).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroPlane {
    pub emitter_distance: f32,
    pub colour_distance: f32,
    pub reference_distance: f32,
    pub reference_pixel_size: f32,
}

#[repr(C)]
pub(super) struct Registration {
    pub(super) info: [i32; 29],
    pub(super) padding: [u16; 3],
    pub(super) zero_plane: ZeroPlane,
    pub(super) const_shift: f64,
    pub(super) tables: [*mut c_void; 3],
}

#[repr(C)]
pub(super) struct Attributes {
    pub(super) next: *mut Attributes,
    pub(super) serial: *const c_char,
}

#[repr(C)]
pub(super) struct TimeValue {
    pub(super) seconds: std::ffi::c_long,
    pub(super) microseconds: std::ffi::c_long,
}

pub(super) type Handle = *mut c_void;
pub(super) type FrameCallback = extern "C" fn(Handle, *mut c_void, u32);
pub(super) type LogCallback = extern "C" fn(Handle, c_int, *const c_char);
pub(super) type Plain = unsafe extern "C" fn(Handle) -> c_int;
pub(super) type FindMode = unsafe extern "C" fn(c_int, c_int) -> FrameMode;
pub(super) type SetMode = unsafe extern "C" fn(Handle, FrameMode) -> c_int;
pub(super) type SetCallback = unsafe extern "C" fn(Handle, FrameCallback);

/// The functions used. Those that the stand-in lacks are optional.
pub(super) struct Functions {
    pub(super) init: unsafe extern "C" fn(*mut Handle, Handle) -> c_int,
    pub(super) shutdown: Plain,
    pub(super) set_log_level: unsafe extern "C" fn(Handle, c_int),
    pub(super) set_log_callback: unsafe extern "C" fn(Handle, LogCallback),
    pub(super) select_subdevices: Option<unsafe extern "C" fn(Handle, c_int)>,
    pub(super) devices: Plain,
    pub(super) list: Option<unsafe extern "C" fn(Handle, *mut *mut Attributes) -> c_int>,
    pub(super) free_list: Option<unsafe extern "C" fn(*mut Attributes)>,
    pub(super) open: unsafe extern "C" fn(Handle, *mut Handle, c_int) -> c_int,
    pub(super) open_serial: unsafe extern "C" fn(Handle, *mut Handle, *const c_char) -> c_int,
    pub(super) close: Plain,
    pub(super) find_depth_mode: FindMode,
    pub(super) set_depth_mode: SetMode,
    pub(super) set_depth_callback: SetCallback,
    pub(super) start_depth: Plain,
    pub(super) stop_depth: Plain,
    pub(super) find_video_mode: FindMode,
    pub(super) set_video_mode: SetMode,
    pub(super) set_video_callback: SetCallback,
    pub(super) start_video: Plain,
    pub(super) stop_video: Plain,
    pub(super) process: unsafe extern "C" fn(Handle, *mut TimeValue) -> c_int,
    pub(super) copy_registration: Option<unsafe extern "C" fn(Handle) -> Registration>,
    pub(super) destroy_registration: Option<unsafe extern "C" fn(*mut Registration) -> c_int>,
}

/// A symbol as a function pointer of the type it is asked as.
///
/// # Safety
/// The type must be the C function's.
unsafe fn symbol<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
    // SAFETY: the caller's promise; the pointer is used only while the library is loaded.
    unsafe { library.get::<T>(name.as_bytes()) }
        .map(|s| *s)
        .map_err(|_| format!("it has no {name}"))
}

impl Functions {
    pub(super) fn of(library: &Library) -> Result<Self, String> {
        // SAFETY: every type is transcribed from the headers named above.
        unsafe {
            Ok(Functions {
                init: symbol(library, "freenect_init")?,
                shutdown: symbol(library, "freenect_shutdown")?,
                set_log_level: symbol(library, "freenect_set_log_level")?,
                set_log_callback: symbol(library, "freenect_set_log_callback")?,
                select_subdevices: symbol(library, "freenect_select_subdevices").ok(),
                devices: symbol(library, "freenect_num_devices")?,
                list: symbol(library, LIST).ok(),
                free_list: symbol(library, "freenect_free_device_attributes").ok(),
                open: symbol(library, "freenect_open_device")?,
                open_serial: symbol(library, "freenect_open_device_by_camera_serial")?,
                close: symbol(library, "freenect_close_device")?,
                find_depth_mode: symbol(library, "freenect_find_depth_mode")?,
                set_depth_mode: symbol(library, "freenect_set_depth_mode")?,
                set_depth_callback: symbol(library, "freenect_set_depth_callback")?,
                start_depth: symbol(library, "freenect_start_depth")?,
                stop_depth: symbol(library, "freenect_stop_depth")?,
                find_video_mode: symbol(library, "freenect_find_video_mode")?,
                set_video_mode: symbol(library, "freenect_set_video_mode")?,
                set_video_callback: symbol(library, "freenect_set_video_callback")?,
                start_video: symbol(library, "freenect_start_video")?,
                stop_video: symbol(library, "freenect_stop_video")?,
                process: symbol(library, "freenect_process_events_timeout")?,
                copy_registration: symbol(library, "freenect_copy_registration").ok(),
                destroy_registration: symbol(library, "freenect_destroy_registration").ok(),
            })
        }
    }
}
