//! Embree geometries and scenes.
#![allow(unsafe_code)]

use super::callbacks::{self, GeometryContext};
use super::device::Device;
use super::error::EmbreeError;
use crate::geometry::{GeometryId, GeometrySet, Shape};
use embree4_sys as sys;
use embree4_sys::{RTCBufferType, RTCFormat, RTCGeometryType, RTCSceneFlags};
use lumiris_numbers::math::Affine3A;
use std::any::Any;
use std::ffi::c_void;
use std::sync::Arc;

/// All kinds of rays may enter an instance. The geometries of its group have their own masks.
const INSTANCE_MASK: u32 = u32::MAX;

/// The scene flag that allows a filter function per query.
#[cfg(embree3)]
const QUERY_FILTER: RTCSceneFlags = RTCSceneFlags::RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
#[cfg(embree4)]
const QUERY_FILTER: RTCSceneFlags = RTCSceneFlags::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;

/// Callbacks of a geometry.
pub(super) struct UserCallbacks {
    pub bounds: sys::RTCBoundsFunction,
    pub intersect: sys::RTCIntersectFunctionN,
    pub occluded: sys::RTCOccludedFunctionN,
}

/// Callbacks of quadrics and patches.
const OF_SHAPES: UserCallbacks = UserCallbacks {
    bounds: Some(callbacks::bounds),
    intersect: Some(callbacks::intersect),
    occluded: Some(callbacks::occluded),
};

/// A geometry that is not attached to a scene yet.
pub(super) struct EmbreeGeometry {
    raw: sys::RTCGeometry,
    device: Arc<Device>,
    /// User data of the callbacks. Moves into the scene.
    context: Option<Arc<GeometryContext>>,
}

impl EmbreeGeometry {
    pub(super) fn new(device: &Arc<Device>, kind: RTCGeometryType) -> Result<Self, EmbreeError> {
        // SAFETY: the device is live.
        let raw = unsafe { sys::rtcNewGeometry(device.raw(), kind) };
        let geometry = EmbreeGeometry { raw, device: Arc::clone(device), context: None };
        device.check("create a geometry")?;
        Ok(geometry)
    }

    /// The geometry of a shape, with shared buffers. The scene that it is attached to must hold `set`.
    fn of_shape(
        device: &Arc<Device>,
        set: &GeometrySet,
        id: GeometryId,
        context: Arc<GeometryContext>,
    ) -> Result<Self, EmbreeError> {
        let geometry = &set.geometries[id as usize];
        let mut result = match &geometry.shape {
            Shape::Mesh(mesh) => {
                let result = Self::new(device, RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE)?;
                let (positions, indices) = (mesh.padded_positions(), &mesh.indices);
                result.share(RTCBufferType::RTC_BUFFER_TYPE_VERTEX, positions.as_ptr(), mesh.positions().len())?;
                result.share(RTCBufferType::RTC_BUFFER_TYPE_INDEX, indices.as_ptr(), indices.len())?;
                result
            }
            Shape::Quadric(_) => Self::user(device, 1, &OF_SHAPES)?,
            Shape::Bilinear(mesh) => Self::user(device, mesh.patch_count(), &OF_SHAPES)?,
            // No scene has them
            Shape::Curves(_) => Self::user(device, 0, &OF_SHAPES)?,
        };
        let user: *mut c_void = Arc::as_ptr(&context).cast_mut().cast();
        // SAFETY: the geometry, then the scene keeps the context, so it outlives the callbacks, which only read it.
        // Filters are for triangles only: the callbacks of other shapes apply the alpha test themselves.
        unsafe {
            sys::rtcSetGeometryUserData(result.raw, user);
            if context.has_alpha() && matches!(geometry.shape, Shape::Mesh(_)) {
                sys::rtcSetGeometryIntersectFilterFunction(result.raw, Some(callbacks::alpha_filter));
                sys::rtcSetGeometryOccludedFilterFunction(result.raw, Some(callbacks::alpha_filter));
            }
            sys::rtcSetGeometryMask(result.raw, geometry.visibility.0);
            sys::rtcSetGeometryBuildQuality(result.raw, sys::RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM);
        }
        result.context = Some(context);
        result.commit()?;
        Ok(result)
    }

    /// Shares a buffer of `count` elements with three words each.
    pub(super) fn share<T>(&self, kind: RTCBufferType, data: *const T, count: usize) -> Result<(), EmbreeError> {
        const { assert!(size_of::<T>() == 12) };
        let vertex = kind == RTCBufferType::RTC_BUFFER_TYPE_VERTEX;
        let format = if vertex { RTCFormat::RTC_FORMAT_FLOAT3 } else { RTCFormat::RTC_FORMAT_UINT3 };
        // SAFETY: Embree stores the pointer. The scene keeps the mesh, vertices are followed by an element of padding,
        // and indices are in range by the mesh's construction.
        unsafe { sys::rtcSetSharedGeometryBuffer(self.raw, kind, 0, format, data.cast(), 0, 12, count) };
        self.device.check("share a buffer of a mesh")
    }

    /// A geometry of `count` primitives that are intersected by callbacks.
    fn user(device: &Arc<Device>, count: usize, callbacks: &UserCallbacks) -> Result<Self, EmbreeError> {
        let count = u32::try_from(count).map_err(|_| EmbreeError::TooManyPrimitives)?;
        let result = Self::new(device, RTCGeometryType::RTC_GEOMETRY_TYPE_USER)?;
        // SAFETY: the geometry is live; the callbacks get the user data, which is set before the commit.
        unsafe {
            sys::rtcSetGeometryUserPrimitiveCount(result.raw, count);
            sys::rtcSetGeometryBoundsFunction(result.raw, callbacks.bounds, std::ptr::null_mut());
            sys::rtcSetGeometryIntersectFunction(result.raw, callbacks.intersect);
            sys::rtcSetGeometryOccludedFunction(result.raw, callbacks.occluded);
        }
        device.check("describe a quadric or patches")?;
        Ok(result)
    }

    /// An instance of a group's scene.
    fn placing(device: &Arc<Device>, group: &EmbreeScene, samples: &[Affine3A]) -> Result<Self, EmbreeError> {
        let result = Self::new(device, RTCGeometryType::RTC_GEOMETRY_TYPE_INSTANCE)?;
        // SAFETY: both handles are live; each matrix is read during its call: 12 floats, column by column.
        unsafe {
            sys::rtcSetGeometryInstancedScene(result.raw, group.raw);
            if samples.len() > 1 {
                let count = u32::try_from(samples.len()).unwrap_or(u32::MAX);
                sys::rtcSetGeometryTimeStepCount(result.raw, count);
            }
            for (step, world_from_group) in (0_u32..).zip(samples) {
                let columns = world_from_group.to_cols_array();
                let format = RTCFormat::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
                sys::rtcSetGeometryTransform(result.raw, step, format, columns.as_ptr().cast());
            }
            sys::rtcSetGeometryMask(result.raw, INSTANCE_MASK);
        }
        result.commit()?;
        Ok(result)
    }

    fn commit(&self) -> Result<(), EmbreeError> {
        // SAFETY: the geometry is live.
        unsafe { sys::rtcCommitGeometry(self.raw) };
        self.device.check("commit a geometry")
    }
}

impl Drop for EmbreeGeometry {
    fn drop(&mut self) {
        if !self.raw.is_null() {
            // SAFETY: released once; a scene that it was attached to holds a reference of its own.
            unsafe { sys::rtcReleaseGeometry(self.raw) };
        }
    }
}

/// A scene, and the owners of all memory that Embree points to.
pub(super) struct EmbreeScene {
    raw: sys::RTCScene,
    device: Arc<Device>,
    /// User data of the geometries.
    contexts: Vec<Arc<GeometryContext>>,
    /// Scenes of the instances.
    groups: Vec<Arc<EmbreeScene>>,
    /// The id of the next geometry or instance.
    next_id: u32,
    /// User data of [`Self::add_user`].
    user_data: Vec<Arc<dyn Any + Send + Sync>>,
    /// Owner of the shared buffers.
    _set: Arc<GeometrySet>,
}

// SAFETY: after the commit, queries may run on any number of threads at once; before it, only the builder has the
// scene.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above. The contexts are read only.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// An empty scene. `query_filter` is true if queries have a filter function.
    pub(super) fn new(device: &Arc<Device>, set: &Arc<GeometrySet>, query_filter: bool) -> Result<Self, EmbreeError> {
        // SAFETY: the device is live.
        let raw = unsafe { sys::rtcNewScene(device.raw()) };
        let scene = EmbreeScene {
            raw,
            device: Arc::clone(device),
            contexts: Vec::new(),
            groups: Vec::new(),
            next_id: 0,
            user_data: Vec::new(),
            _set: Arc::clone(set),
        };
        device.check("create a scene")?;
        let query_filter = if query_filter { QUERY_FILTER.0 } else { 0 };
        let flags = RTCSceneFlags(RTCSceneFlags::RTC_SCENE_FLAG_ROBUST.0 | query_filter);
        // SAFETY: the scene is live.
        unsafe {
            sys::rtcSetSceneFlags(raw, flags);
            sys::rtcSetSceneBuildQuality(raw, sys::RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM);
        }
        Ok(scene)
    }

    /// Adds a shape. Ids count from 0 in the order of the calls.
    pub(super) fn add_shape(&mut self, id: GeometryId, context: GeometryContext) -> Result<(), EmbreeError> {
        let set = Arc::clone(&self._set);
        let geometry = EmbreeGeometry::of_shape(&self.device, &set, id, Arc::new(context))?;
        self.attach(geometry)
    }

    /// Adds `count` primitives that are intersected by callbacks, with `data` for them.
    ///
    /// # Safety
    /// The callbacks only read their user data, as a `T`.
    pub(super) unsafe fn add_user<T: Any + Send + Sync>(
        &mut self,
        data: T,
        count: usize,
        callbacks: &UserCallbacks,
    ) -> Result<(), EmbreeError> {
        let geometry = EmbreeGeometry::user(&self.device, count, callbacks)?;
        let data = Arc::new(data);
        let pointer: *mut c_void = Arc::as_ptr(&data).cast_mut().cast();
        self.user_data.push(data);
        // SAFETY: the geometry is live, and the scene keeps the data, so it outlives the callbacks.
        unsafe {
            sys::rtcSetGeometryUserData(geometry.raw, pointer);
            sys::rtcSetGeometryMask(geometry.raw, INSTANCE_MASK);
        }
        geometry.commit()?;
        self.attach(geometry)
    }

    /// Adds an instance of a committed scene, with its transforms at equidistant times.
    pub(super) fn add_instance(
        &mut self,
        group: &Arc<EmbreeScene>,
        world_from_group: &[Affine3A],
    ) -> Result<(), EmbreeError> {
        let geometry = EmbreeGeometry::placing(&self.device, group, world_from_group)?;
        if self.groups.last().is_none_or(|last| !Arc::ptr_eq(last, group)) {
            self.groups.push(Arc::clone(group));
        }
        self.attach(geometry)
    }

    fn attach(&mut self, mut geometry: EmbreeGeometry) -> Result<(), EmbreeError> {
        self.contexts.extend(geometry.context.take());
        // SAFETY: both are live; the scene takes a reference.
        unsafe { sys::rtcAttachGeometryByID(self.raw, geometry.raw, self.next_id) };
        self.skip_id();
        self.device.check("attach a geometry")
    }

    /// Leaves out an id.
    pub(super) fn skip_id(&mut self) {
        self.next_id += 1;
    }

    /// Builds the hierarchy, on all cores.
    pub(super) fn commit(&self) -> Result<(), EmbreeError> {
        // SAFETY: the scene is live and nobody queries it yet.
        unsafe { sys::rtcCommitScene(self.raw) };
        self.device.check("build a scene")
    }

    pub(super) fn raw(&self) -> sys::RTCScene {
        self.raw
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        if !self.raw.is_null() {
            // SAFETY: released once. Fields are dropped after this, so the memory that the scene points to outlives it.
            // A scene with instances of this one holds it by `Arc`.
            unsafe { sys::rtcReleaseScene(self.raw) };
        }
    }
}
