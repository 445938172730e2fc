//! One triangle: hits, misses, packets and errors, in the family chosen by the build script.

use embree4_sys::*;
use std::ffi::{CStr, c_char, c_void};
use std::ptr;
use std::sync::Mutex;

/// A device with the triangle (0,0,0), (1,0,0), (0,1,0), released on drop.
struct Triangle {
    device: RTCDevice,
    scene: RTCScene,
}

impl Triangle {
    fn new() -> Triangle {
        // SAFETY: a null configuration is allowed. The buffers are used before the geometry is
        // committed, and are as long as asked for: three vertices of three floats, one triangle.
        unsafe {
            let device = rtcNewDevice(ptr::null());
            assert!(!device.is_null());
            let geometry = rtcNewGeometry(device, RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE);
            let vertices = rtcSetNewGeometryBuffer(
                geometry,
                RTCBufferType::RTC_BUFFER_TYPE_VERTEX,
                0,
                RTCFormat::RTC_FORMAT_FLOAT3,
                12,
                3,
            );
            let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            vertices.cast::<[[f32; 3]; 3]>().write(corners);
            let indices = rtcSetNewGeometryBuffer(
                geometry,
                RTCBufferType::RTC_BUFFER_TYPE_INDEX,
                0,
                RTCFormat::RTC_FORMAT_UINT3,
                12,
                1,
            );
            indices.cast::<[u32; 3]>().write([0, 1, 2]);
            rtcSetGeometryMask(geometry, u32::MAX);
            rtcCommitGeometry(geometry);

            let scene = rtcNewScene(device);
            rtcSetSceneFlags(scene, RTCSceneFlags::RTC_SCENE_FLAG_ROBUST);
            assert_eq!(rtcAttachGeometry(scene, geometry), 0);
            rtcReleaseGeometry(geometry);
            rtcCommitScene(scene);
            assert_eq!(rtcGetDeviceError(device), RTCError::RTC_ERROR_NONE);
            Triangle { device, scene }
        }
    }

    /// Traces a ray from (x, y, 1) down the z axis.
    fn intersect(&self, x: f32, y: f32) -> RTCRayHit {
        let mut ray_hit = RTCRayHit {
            ray: RTCRay {
                org_x: x,
                org_y: y,
                org_z: 1.0,
                dir_z: -1.0,
                tfar: f32::INFINITY,
                mask: u32::MAX,
                ..RTCRay::default()
            },
            hit: RTCHit { geomID: RTC_INVALID_GEOMETRY_ID, instID: [RTC_INVALID_GEOMETRY_ID], ..RTCHit::default() },
        };
        // SAFETY: the scene is committed, and both pointers are to live, aligned values.
        unsafe {
            #[cfg(embree3)]
            rtcIntersect1(self.scene, &mut rtcInitIntersectContext(), &mut ray_hit);
            #[cfg(embree4)]
            rtcIntersect1(self.scene, &mut ray_hit, &mut rtcInitIntersectArguments());
        }
        ray_hit
    }
}

impl Drop for Triangle {
    fn drop(&mut self) {
        // SAFETY: both were created by `new` and are released once.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

#[test]
fn a_ray_through_the_triangle_hits_it() {
    let found = Triangle::new().intersect(0.25, 0.5);
    assert_eq!(found.hit.geomID, 0);
    assert_eq!(found.hit.primID, 0);
    assert_eq!(found.hit.instID, [RTC_INVALID_GEOMETRY_ID]);
    // Embree divides by a reciprocal whose last bit depends on the processor
    for (value, expected) in [(found.ray.tfar, 1.0), (found.hit.u, 0.25), (found.hit.v, 0.5)] {
        assert!((value - expected).abs() <= 2.0 * f32::EPSILON * expected, "{value} {expected}");
    }
    assert_eq!((found.hit.Ng_x, found.hit.Ng_y, found.hit.Ng_z), (0.0, 0.0, 1.0));
}

#[test]
fn a_ray_beside_the_triangle_leaves_the_hit_as_it_was() {
    let found = Triangle::new().intersect(0.75, 0.5);
    assert_eq!(found.hit.geomID, RTC_INVALID_GEOMETRY_ID);
    assert_eq!(found.ray.tfar, f32::INFINITY);
}

#[test]
fn a_packet_of_eight_tells_the_occluded_rays_and_skips_invalid_lanes() {
    #[repr(align(32))]
    struct Valid([i32; 8]);

    let triangle = Triangle::new();
    let mut rays = RTCRay8 {
        // Lanes alternate between inside and outside
        org_x: [0.25, 2.0, 0.25, 2.0, 0.25, 2.0, 0.25, 2.0],
        org_y: [0.25; 8],
        org_z: [1.0; 8],
        dir_z: [-1.0; 8],
        // Lane 2 ends above the triangle
        tfar: [2.0, 2.0, 0.5, 2.0, 2.0, 2.0, 2.0, 2.0],
        mask: [u32::MAX; 8],
        ..RTCRay8::default()
    };
    // Lane 4 is inactive
    let valid = Valid([-1, -1, -1, -1, 0, -1, -1, -1]);
    let valid = valid.0.as_ptr();
    // SAFETY: the scene is committed; `valid` and `rays` are aligned to 32 bytes by their types.
    unsafe {
        #[cfg(embree3)]
        rtcOccluded8(valid, triangle.scene, &mut rtcInitIntersectContext(), &mut rays);
        #[cfg(embree4)]
        rtcOccluded8(valid, triangle.scene, &mut rays, &mut rtcInitOccludedArguments());
    }
    let occluded = rays.tfar.map(|tfar| tfar == f32::NEG_INFINITY);
    assert_eq!(occluded, [true, false, false, false, false, false, true, false]);
}

/// Stores the code and message of an error.
unsafe extern "C" fn on_error(user: *mut c_void, code: RTCError, message: *const c_char) {
    // SAFETY: `user` is the mutex of the test, which outlives the device, and Embree passes a
    // message that ends in a zero byte.
    let (log, message) = unsafe {
        let log = &*user.cast::<Mutex<Vec<(RTCError, String)>>>();
        (log, CStr::from_ptr(message).to_string_lossy().into_owned())
    };
    log.lock().unwrap().push((code, message));
}

#[test]
fn a_wrong_call_reaches_the_error_function() {
    let log: Mutex<Vec<(RTCError, String)>> = Mutex::new(Vec::new());
    let triangle = Triangle::new();
    // SAFETY: `log` outlives `triangle`, being declared before it. Embree checks for an unknown
    // geometry id.
    unsafe {
        let user = (&raw const log).cast_mut().cast();
        rtcSetDeviceErrorFunction(triangle.device, Some(on_error), user);
        rtcDetachGeometry(triangle.scene, 77);
    }
    let log = log.lock().unwrap();
    assert_eq!(log.len(), 1, "{log:?}");
    assert_eq!(log[0].0, RTCError::RTC_ERROR_INVALID_OPERATION);
    assert!(!log[0].1.is_empty());
}

#[test]
fn the_library_is_of_the_family_of_the_headers() {
    let triangle = Triangle::new();
    // SAFETY: the device is live.
    let version = unsafe { rtcGetDeviceProperty(triangle.device, RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION) };
    assert_eq!(version as u32 / 10_000, FAMILY);
    assert_eq!(HEADER_VERSION / 10_000, FAMILY);
}
