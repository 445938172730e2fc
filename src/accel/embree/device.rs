//! The Embree device: errors, memory, capabilities.
#![allow(unsafe_code)]

use super::error::{EmbreeError, ErrorCode};
use embree4_sys as sys;
use embree4_sys::{RTCDeviceProperty as Property, RTCError};
use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Mutex, PoisonError};

/// An Embree device. All other Embree objects hold a reference to it.
#[derive(Debug)]
pub(super) struct Device {
    raw: sys::RTCDevice,
    /// The log written by the device's callbacks. Boxed, because they hold its address.
    log: Box<DeviceLog>,
}

// SAFETY: Embree's device functions may be called from any thread, and the log is synchronised.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

#[derive(Debug)]
struct DeviceLog {
    errors: Mutex<Vec<(ErrorCode, String)>>,
    bytes: AtomicI64,
    peak_bytes: AtomicI64,
    limit: i64,
}

impl Device {
    /// A device whose structures take at most `memory_limit` bytes, if given. `config` is an Embree configuration
    /// string.
    pub(super) fn new(config: &CStr, memory_limit: Option<u64>) -> Result<Device, EmbreeError> {
        // SAFETY: the configuration ends in a zero byte and is read during the call.
        let raw = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if raw.is_null() {
            // SAFETY: null asks for the error of the last failed rtcNewDevice of this thread.
            let code = ErrorCode::from(unsafe { sys::rtcGetDeviceError(std::ptr::null_mut()) });
            return Err(EmbreeError::Call { action: "create a device", code, message: String::new() });
        }
        let limit = memory_limit.map_or(i64::MAX, |limit| i64::try_from(limit).unwrap_or(i64::MAX));
        let log = Box::new(DeviceLog {
            errors: Mutex::new(Vec::new()),
            bytes: AtomicI64::new(0),
            peak_bytes: AtomicI64::new(0),
            limit,
        });
        let device = Device { raw, log };
        let user: *mut c_void = (&raw const *device.log).cast_mut().cast();
        // SAFETY: the log is boxed and freed after the device (`drop` releases the device first).
        unsafe {
            sys::rtcSetDeviceErrorFunction(raw, Some(on_error), user);
            sys::rtcSetDeviceMemoryMonitorFunction(raw, Some(on_memory), user);
        }
        Ok(device)
    }

    pub(super) fn raw(&self) -> sys::RTCDevice {
        self.raw
    }

    /// Returns the first error since the last call, as the failure of `action`.
    pub(super) fn check(&self, action: &'static str) -> Result<(), EmbreeError> {
        // SAFETY: the device is live.
        let code = ErrorCode::from(unsafe { sys::rtcGetDeviceError(self.raw) });
        let mut errors = self.log.errors.lock().unwrap_or_else(PoisonError::into_inner);
        let first = errors.drain(..).next();
        match (first, code) {
            (Some((code, message)), _) => Err(EmbreeError::Call { action, code, message }),
            (None, ErrorCode::None) => Ok(()),
            (None, code) => Err(EmbreeError::Call { action, code, message: String::new() }),
        }
    }

    /// True if this build of Embree has a feature.
    pub(super) fn has(&self, property: Property) -> bool {
        // SAFETY: the device is live; an unknown property is an error, not undefined.
        unsafe { sys::rtcGetDeviceProperty(self.raw, property) != 0 }
    }

    /// Current memory.
    pub(super) fn bytes(&self) -> u64 {
        u64::try_from(self.log.bytes.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// Peak memory.
    pub(super) fn peak_bytes(&self) -> u64 {
        u64::try_from(self.log.peak_bytes.load(Ordering::Relaxed)).unwrap_or(0)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: released once. Scenes keep the device itself alive within Embree, but each of ours holds an `Arc` of
        // this value, so they are gone and no callback runs from here on.
        unsafe { sys::rtcReleaseDevice(self.raw) };
    }
}

/// Embree's error callback.
unsafe extern "C" fn on_error(user: *mut c_void, code: RTCError, message: *const c_char) {
    // SAFETY: `user` is the device's log, which outlives the device.
    let log = unsafe { &*user.cast::<DeviceLog>() };
    let message = if message.is_null() {
        String::new()
    } else {
        // SAFETY: Embree passes a string that ends in a zero byte.
        unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
    };
    log.errors.lock().unwrap_or_else(PoisonError::into_inner).push((ErrorCode::from(code), message));
}

/// Embree's memory callback: called before an allocation (`bytes` > 0) and after a release. Returning false denies an
/// allocation.
unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, post: bool) -> bool {
    // SAFETY: `user` is the device's log, which outlives the device.
    let log = unsafe { &*user.cast::<DeviceLog>() };
    let bytes = bytes as i64;
    let now = log.bytes.fetch_add(bytes, Ordering::Relaxed) + bytes;
    if bytes > 0 && !post && now > log.limit {
        log.bytes.fetch_sub(bytes, Ordering::Relaxed);
        return false;
    }
    log.peak_bytes.fetch_max(now, Ordering::Relaxed);
    true
}
