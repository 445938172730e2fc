// Made by bindgen from the headers of Embree 3.13.5, see README.md. Do not edit.


pub const RTC_MAX_INSTANCE_LEVEL_COUNT: u32 = 1;
pub const RTC_MIN_WIDTH: u32 = 0;
pub const RTC_MAX_TIME_STEP_COUNT: u32 = 129;
impl RTCFormat {
    pub const RTC_FORMAT_UNDEFINED: RTCFormat = RTCFormat(0);
    pub const RTC_FORMAT_UCHAR: RTCFormat = RTCFormat(4097);
    pub const RTC_FORMAT_UCHAR2: RTCFormat = RTCFormat(4098);
    pub const RTC_FORMAT_UCHAR3: RTCFormat = RTCFormat(4099);
    pub const RTC_FORMAT_UCHAR4: RTCFormat = RTCFormat(4100);
    pub const RTC_FORMAT_CHAR: RTCFormat = RTCFormat(8193);
    pub const RTC_FORMAT_CHAR2: RTCFormat = RTCFormat(8194);
    pub const RTC_FORMAT_CHAR3: RTCFormat = RTCFormat(8195);
    pub const RTC_FORMAT_CHAR4: RTCFormat = RTCFormat(8196);
    pub const RTC_FORMAT_USHORT: RTCFormat = RTCFormat(12289);
    pub const RTC_FORMAT_USHORT2: RTCFormat = RTCFormat(12290);
    pub const RTC_FORMAT_USHORT3: RTCFormat = RTCFormat(12291);
    pub const RTC_FORMAT_USHORT4: RTCFormat = RTCFormat(12292);
    pub const RTC_FORMAT_SHORT: RTCFormat = RTCFormat(16385);
    pub const RTC_FORMAT_SHORT2: RTCFormat = RTCFormat(16386);
    pub const RTC_FORMAT_SHORT3: RTCFormat = RTCFormat(16387);
    pub const RTC_FORMAT_SHORT4: RTCFormat = RTCFormat(16388);
    pub const RTC_FORMAT_UINT: RTCFormat = RTCFormat(20481);
    pub const RTC_FORMAT_UINT2: RTCFormat = RTCFormat(20482);
    pub const RTC_FORMAT_UINT3: RTCFormat = RTCFormat(20483);
    pub const RTC_FORMAT_UINT4: RTCFormat = RTCFormat(20484);
    pub const RTC_FORMAT_INT: RTCFormat = RTCFormat(24577);
    pub const RTC_FORMAT_INT2: RTCFormat = RTCFormat(24578);
    pub const RTC_FORMAT_INT3: RTCFormat = RTCFormat(24579);
    pub const RTC_FORMAT_INT4: RTCFormat = RTCFormat(24580);
    pub const RTC_FORMAT_ULLONG: RTCFormat = RTCFormat(28673);
    pub const RTC_FORMAT_ULLONG2: RTCFormat = RTCFormat(28674);
    pub const RTC_FORMAT_ULLONG3: RTCFormat = RTCFormat(28675);
    pub const RTC_FORMAT_ULLONG4: RTCFormat = RTCFormat(28676);
    pub const RTC_FORMAT_LLONG: RTCFormat = RTCFormat(32769);
    pub const RTC_FORMAT_LLONG2: RTCFormat = RTCFormat(32770);
    pub const RTC_FORMAT_LLONG3: RTCFormat = RTCFormat(32771);
    pub const RTC_FORMAT_LLONG4: RTCFormat = RTCFormat(32772);
    pub const RTC_FORMAT_FLOAT: RTCFormat = RTCFormat(36865);
    pub const RTC_FORMAT_FLOAT2: RTCFormat = RTCFormat(36866);
    pub const RTC_FORMAT_FLOAT3: RTCFormat = RTCFormat(36867);
    pub const RTC_FORMAT_FLOAT4: RTCFormat = RTCFormat(36868);
    pub const RTC_FORMAT_FLOAT5: RTCFormat = RTCFormat(36869);
    pub const RTC_FORMAT_FLOAT6: RTCFormat = RTCFormat(36870);
    pub const RTC_FORMAT_FLOAT7: RTCFormat = RTCFormat(36871);
    pub const RTC_FORMAT_FLOAT8: RTCFormat = RTCFormat(36872);
    pub const RTC_FORMAT_FLOAT9: RTCFormat = RTCFormat(36873);
    pub const RTC_FORMAT_FLOAT10: RTCFormat = RTCFormat(36874);
    pub const RTC_FORMAT_FLOAT11: RTCFormat = RTCFormat(36875);
    pub const RTC_FORMAT_FLOAT12: RTCFormat = RTCFormat(36876);
    pub const RTC_FORMAT_FLOAT13: RTCFormat = RTCFormat(36877);
    pub const RTC_FORMAT_FLOAT14: RTCFormat = RTCFormat(36878);
    pub const RTC_FORMAT_FLOAT15: RTCFormat = RTCFormat(36879);
    pub const RTC_FORMAT_FLOAT16: RTCFormat = RTCFormat(36880);
    pub const RTC_FORMAT_FLOAT2X2_ROW_MAJOR: RTCFormat = RTCFormat(37154);
    pub const RTC_FORMAT_FLOAT2X3_ROW_MAJOR: RTCFormat = RTCFormat(37155);
    pub const RTC_FORMAT_FLOAT2X4_ROW_MAJOR: RTCFormat = RTCFormat(37156);
    pub const RTC_FORMAT_FLOAT3X2_ROW_MAJOR: RTCFormat = RTCFormat(37170);
    pub const RTC_FORMAT_FLOAT3X3_ROW_MAJOR: RTCFormat = RTCFormat(37171);
    pub const RTC_FORMAT_FLOAT3X4_ROW_MAJOR: RTCFormat = RTCFormat(37172);
    pub const RTC_FORMAT_FLOAT4X2_ROW_MAJOR: RTCFormat = RTCFormat(37186);
    pub const RTC_FORMAT_FLOAT4X3_ROW_MAJOR: RTCFormat = RTCFormat(37187);
    pub const RTC_FORMAT_FLOAT4X4_ROW_MAJOR: RTCFormat = RTCFormat(37188);
    pub const RTC_FORMAT_FLOAT2X2_COLUMN_MAJOR: RTCFormat = RTCFormat(37410);
    pub const RTC_FORMAT_FLOAT2X3_COLUMN_MAJOR: RTCFormat = RTCFormat(37411);
    pub const RTC_FORMAT_FLOAT2X4_COLUMN_MAJOR: RTCFormat = RTCFormat(37412);
    pub const RTC_FORMAT_FLOAT3X2_COLUMN_MAJOR: RTCFormat = RTCFormat(37426);
    pub const RTC_FORMAT_FLOAT3X3_COLUMN_MAJOR: RTCFormat = RTCFormat(37427);
    pub const RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR: RTCFormat = RTCFormat(37428);
    pub const RTC_FORMAT_FLOAT4X2_COLUMN_MAJOR: RTCFormat = RTCFormat(37442);
    pub const RTC_FORMAT_FLOAT4X3_COLUMN_MAJOR: RTCFormat = RTCFormat(37443);
    pub const RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR: RTCFormat = RTCFormat(37444);
    pub const RTC_FORMAT_GRID: RTCFormat = RTCFormat(40961);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCFormat(pub ::std::os::raw::c_uint);
impl RTCBuildQuality {
    pub const RTC_BUILD_QUALITY_LOW: RTCBuildQuality = RTCBuildQuality(0);
    pub const RTC_BUILD_QUALITY_MEDIUM: RTCBuildQuality = RTCBuildQuality(1);
    pub const RTC_BUILD_QUALITY_HIGH: RTCBuildQuality = RTCBuildQuality(2);
    pub const RTC_BUILD_QUALITY_REFIT: RTCBuildQuality = RTCBuildQuality(3);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCBuildQuality(pub ::std::os::raw::c_uint);
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCBounds {
    pub lower_x: f32,
    pub lower_y: f32,
    pub lower_z: f32,
    pub align0: f32,
    pub upper_x: f32,
    pub upper_y: f32,
    pub upper_z: f32,
    pub align1: f32,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCBounds"][::std::mem::size_of::<RTCBounds>() - 32usize];
    ["Alignment of RTCBounds"][::std::mem::align_of::<RTCBounds>() - 16usize];
    [
        "Offset of field: RTCBounds::lower_x",
    ][::std::mem::offset_of!(RTCBounds, lower_x) - 0usize];
    [
        "Offset of field: RTCBounds::lower_y",
    ][::std::mem::offset_of!(RTCBounds, lower_y) - 4usize];
    [
        "Offset of field: RTCBounds::lower_z",
    ][::std::mem::offset_of!(RTCBounds, lower_z) - 8usize];
    [
        "Offset of field: RTCBounds::align0",
    ][::std::mem::offset_of!(RTCBounds, align0) - 12usize];
    [
        "Offset of field: RTCBounds::upper_x",
    ][::std::mem::offset_of!(RTCBounds, upper_x) - 16usize];
    [
        "Offset of field: RTCBounds::upper_y",
    ][::std::mem::offset_of!(RTCBounds, upper_y) - 20usize];
    [
        "Offset of field: RTCBounds::upper_z",
    ][::std::mem::offset_of!(RTCBounds, upper_z) - 24usize];
    [
        "Offset of field: RTCBounds::align1",
    ][::std::mem::offset_of!(RTCBounds, align1) - 28usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCLinearBounds {
    pub bounds0: RTCBounds,
    pub bounds1: RTCBounds,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCLinearBounds"][::std::mem::size_of::<RTCLinearBounds>() - 64usize];
    [
        "Alignment of RTCLinearBounds",
    ][::std::mem::align_of::<RTCLinearBounds>() - 16usize];
    [
        "Offset of field: RTCLinearBounds::bounds0",
    ][::std::mem::offset_of!(RTCLinearBounds, bounds0) - 0usize];
    [
        "Offset of field: RTCLinearBounds::bounds1",
    ][::std::mem::offset_of!(RTCLinearBounds, bounds1) - 32usize];
};
impl RTCIntersectContextFlags {
    pub const RTC_INTERSECT_CONTEXT_FLAG_NONE: RTCIntersectContextFlags = RTCIntersectContextFlags(
        0,
    );
    pub const RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT: RTCIntersectContextFlags = RTCIntersectContextFlags(
        0,
    );
    pub const RTC_INTERSECT_CONTEXT_FLAG_COHERENT: RTCIntersectContextFlags = RTCIntersectContextFlags(
        1,
    );
}
impl ::std::ops::BitOr<RTCIntersectContextFlags> for RTCIntersectContextFlags {
    type Output = Self;
    #[inline]
    fn bitor(self, other: Self) -> Self {
        RTCIntersectContextFlags(self.0 | other.0)
    }
}
impl ::std::ops::BitOrAssign for RTCIntersectContextFlags {
    #[inline]
    fn bitor_assign(&mut self, rhs: RTCIntersectContextFlags) {
        self.0 |= rhs.0;
    }
}
impl ::std::ops::BitAnd<RTCIntersectContextFlags> for RTCIntersectContextFlags {
    type Output = Self;
    #[inline]
    fn bitand(self, other: Self) -> Self {
        RTCIntersectContextFlags(self.0 & other.0)
    }
}
impl ::std::ops::BitAndAssign for RTCIntersectContextFlags {
    #[inline]
    fn bitand_assign(&mut self, rhs: RTCIntersectContextFlags) {
        self.0 &= rhs.0;
    }
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCIntersectContextFlags(pub ::std::os::raw::c_uint);
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCFilterFunctionNArguments {
    pub valid: *mut ::std::os::raw::c_int,
    pub geometryUserPtr: *mut ::std::os::raw::c_void,
    pub context: *mut RTCIntersectContext,
    pub ray: *mut RTCRayN,
    pub hit: *mut RTCHitN,
    pub N: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCFilterFunctionNArguments",
    ][::std::mem::size_of::<RTCFilterFunctionNArguments>() - 48usize];
    [
        "Alignment of RTCFilterFunctionNArguments",
    ][::std::mem::align_of::<RTCFilterFunctionNArguments>() - 8usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::valid",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, valid) - 0usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::geometryUserPtr",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, geometryUserPtr) - 8usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::context",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, context) - 16usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::ray",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, ray) - 24usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::hit",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, hit) - 32usize];
    [
        "Offset of field: RTCFilterFunctionNArguments::N",
    ][::std::mem::offset_of!(RTCFilterFunctionNArguments, N) - 40usize];
};
impl Default for RTCFilterFunctionNArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCFilterFunctionN = ::std::option::Option<
    unsafe extern "C" fn(args: *const RTCFilterFunctionNArguments),
>;
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCIntersectContext {
    pub flags: RTCIntersectContextFlags,
    pub filter: RTCFilterFunctionN,
    pub instID: [::std::os::raw::c_uint; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCIntersectContext",
    ][::std::mem::size_of::<RTCIntersectContext>() - 24usize];
    [
        "Alignment of RTCIntersectContext",
    ][::std::mem::align_of::<RTCIntersectContext>() - 8usize];
    [
        "Offset of field: RTCIntersectContext::flags",
    ][::std::mem::offset_of!(RTCIntersectContext, flags) - 0usize];
    [
        "Offset of field: RTCIntersectContext::filter",
    ][::std::mem::offset_of!(RTCIntersectContext, filter) - 8usize];
    [
        "Offset of field: RTCIntersectContext::instID",
    ][::std::mem::offset_of!(RTCIntersectContext, instID) - 16usize];
};
impl Default for RTCIntersectContext {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCPointQuery {
    pub x: f32,
    pub y: f32,
    pub z: f32,
    pub time: f32,
    pub radius: f32,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCPointQuery"][::std::mem::size_of::<RTCPointQuery>() - 32usize];
    ["Alignment of RTCPointQuery"][::std::mem::align_of::<RTCPointQuery>() - 16usize];
    [
        "Offset of field: RTCPointQuery::x",
    ][::std::mem::offset_of!(RTCPointQuery, x) - 0usize];
    [
        "Offset of field: RTCPointQuery::y",
    ][::std::mem::offset_of!(RTCPointQuery, y) - 4usize];
    [
        "Offset of field: RTCPointQuery::z",
    ][::std::mem::offset_of!(RTCPointQuery, z) - 8usize];
    [
        "Offset of field: RTCPointQuery::time",
    ][::std::mem::offset_of!(RTCPointQuery, time) - 12usize];
    [
        "Offset of field: RTCPointQuery::radius",
    ][::std::mem::offset_of!(RTCPointQuery, radius) - 16usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCPointQuery4 {
    pub x: [f32; 4usize],
    pub y: [f32; 4usize],
    pub z: [f32; 4usize],
    pub time: [f32; 4usize],
    pub radius: [f32; 4usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCPointQuery4"][::std::mem::size_of::<RTCPointQuery4>() - 80usize];
    ["Alignment of RTCPointQuery4"][::std::mem::align_of::<RTCPointQuery4>() - 16usize];
    [
        "Offset of field: RTCPointQuery4::x",
    ][::std::mem::offset_of!(RTCPointQuery4, x) - 0usize];
    [
        "Offset of field: RTCPointQuery4::y",
    ][::std::mem::offset_of!(RTCPointQuery4, y) - 16usize];
    [
        "Offset of field: RTCPointQuery4::z",
    ][::std::mem::offset_of!(RTCPointQuery4, z) - 32usize];
    [
        "Offset of field: RTCPointQuery4::time",
    ][::std::mem::offset_of!(RTCPointQuery4, time) - 48usize];
    [
        "Offset of field: RTCPointQuery4::radius",
    ][::std::mem::offset_of!(RTCPointQuery4, radius) - 64usize];
};
#[repr(C)]
#[repr(align(32))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCPointQuery8 {
    pub x: [f32; 8usize],
    pub y: [f32; 8usize],
    pub z: [f32; 8usize],
    pub time: [f32; 8usize],
    pub radius: [f32; 8usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCPointQuery8"][::std::mem::size_of::<RTCPointQuery8>() - 160usize];
    ["Alignment of RTCPointQuery8"][::std::mem::align_of::<RTCPointQuery8>() - 32usize];
    [
        "Offset of field: RTCPointQuery8::x",
    ][::std::mem::offset_of!(RTCPointQuery8, x) - 0usize];
    [
        "Offset of field: RTCPointQuery8::y",
    ][::std::mem::offset_of!(RTCPointQuery8, y) - 32usize];
    [
        "Offset of field: RTCPointQuery8::z",
    ][::std::mem::offset_of!(RTCPointQuery8, z) - 64usize];
    [
        "Offset of field: RTCPointQuery8::time",
    ][::std::mem::offset_of!(RTCPointQuery8, time) - 96usize];
    [
        "Offset of field: RTCPointQuery8::radius",
    ][::std::mem::offset_of!(RTCPointQuery8, radius) - 128usize];
};
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Copy, Clone)]
pub struct RTCPointQuery16 {
    pub x: [f32; 16usize],
    pub y: [f32; 16usize],
    pub z: [f32; 16usize],
    pub time: [f32; 16usize],
    pub radius: [f32; 16usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCPointQuery16"][::std::mem::size_of::<RTCPointQuery16>() - 320usize];
    [
        "Alignment of RTCPointQuery16",
    ][::std::mem::align_of::<RTCPointQuery16>() - 64usize];
    [
        "Offset of field: RTCPointQuery16::x",
    ][::std::mem::offset_of!(RTCPointQuery16, x) - 0usize];
    [
        "Offset of field: RTCPointQuery16::y",
    ][::std::mem::offset_of!(RTCPointQuery16, y) - 64usize];
    [
        "Offset of field: RTCPointQuery16::z",
    ][::std::mem::offset_of!(RTCPointQuery16, z) - 128usize];
    [
        "Offset of field: RTCPointQuery16::time",
    ][::std::mem::offset_of!(RTCPointQuery16, time) - 192usize];
    [
        "Offset of field: RTCPointQuery16::radius",
    ][::std::mem::offset_of!(RTCPointQuery16, radius) - 256usize];
};
impl Default for RTCPointQuery16 {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[derive(Debug)]
pub struct RTCPointQueryN {
    _unused: [u8; 0],
}
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCPointQueryContext {
    pub world2inst: [[f32; 16usize]; 1usize],
    pub inst2world: [[f32; 16usize]; 1usize],
    pub instID: [::std::os::raw::c_uint; 1usize],
    pub instStackSize: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCPointQueryContext",
    ][::std::mem::size_of::<RTCPointQueryContext>() - 144usize];
    [
        "Alignment of RTCPointQueryContext",
    ][::std::mem::align_of::<RTCPointQueryContext>() - 16usize];
    [
        "Offset of field: RTCPointQueryContext::world2inst",
    ][::std::mem::offset_of!(RTCPointQueryContext, world2inst) - 0usize];
    [
        "Offset of field: RTCPointQueryContext::inst2world",
    ][::std::mem::offset_of!(RTCPointQueryContext, inst2world) - 64usize];
    [
        "Offset of field: RTCPointQueryContext::instID",
    ][::std::mem::offset_of!(RTCPointQueryContext, instID) - 128usize];
    [
        "Offset of field: RTCPointQueryContext::instStackSize",
    ][::std::mem::offset_of!(RTCPointQueryContext, instStackSize) - 132usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Copy, Clone)]
pub struct RTCPointQueryFunctionArguments {
    pub query: *mut RTCPointQuery,
    pub userPtr: *mut ::std::os::raw::c_void,
    pub primID: ::std::os::raw::c_uint,
    pub geomID: ::std::os::raw::c_uint,
    pub context: *mut RTCPointQueryContext,
    pub similarityScale: f32,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCPointQueryFunctionArguments",
    ][::std::mem::size_of::<RTCPointQueryFunctionArguments>() - 48usize];
    [
        "Alignment of RTCPointQueryFunctionArguments",
    ][::std::mem::align_of::<RTCPointQueryFunctionArguments>() - 16usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::query",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, query) - 0usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::userPtr",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, userPtr) - 8usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::primID",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, primID) - 16usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::geomID",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, geomID) - 20usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::context",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, context) - 24usize];
    [
        "Offset of field: RTCPointQueryFunctionArguments::similarityScale",
    ][::std::mem::offset_of!(RTCPointQueryFunctionArguments, similarityScale) - 32usize];
};
impl Default for RTCPointQueryFunctionArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCPointQueryFunction = ::std::option::Option<
    unsafe extern "C" fn(args: *mut RTCPointQueryFunctionArguments) -> bool,
>;
#[repr(C)]
#[derive(Debug)]
pub struct RTCDeviceTy {
    _unused: [u8; 0],
}
pub type RTCDevice = *mut RTCDeviceTy;
unsafe extern "C" {
    pub fn rtcNewDevice(config: *const ::std::os::raw::c_char) -> RTCDevice;
}
unsafe extern "C" {
    pub fn rtcRetainDevice(device: RTCDevice);
}
unsafe extern "C" {
    pub fn rtcReleaseDevice(device: RTCDevice);
}
impl RTCDeviceProperty {
    pub const RTC_DEVICE_PROPERTY_VERSION: RTCDeviceProperty = RTCDeviceProperty(0);
    pub const RTC_DEVICE_PROPERTY_VERSION_MAJOR: RTCDeviceProperty = RTCDeviceProperty(
        1,
    );
    pub const RTC_DEVICE_PROPERTY_VERSION_MINOR: RTCDeviceProperty = RTCDeviceProperty(
        2,
    );
    pub const RTC_DEVICE_PROPERTY_VERSION_PATCH: RTCDeviceProperty = RTCDeviceProperty(
        3,
    );
    pub const RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        32,
    );
    pub const RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        33,
    );
    pub const RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        34,
    );
    pub const RTC_DEVICE_PROPERTY_RAY_STREAM_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        35,
    );
    pub const RTC_DEVICE_PROPERTY_BACKFACE_CULLING_CURVES_ENABLED: RTCDeviceProperty = RTCDeviceProperty(
        63,
    );
    pub const RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        64,
    );
    pub const RTC_DEVICE_PROPERTY_BACKFACE_CULLING_ENABLED: RTCDeviceProperty = RTCDeviceProperty(
        65,
    );
    pub const RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        66,
    );
    pub const RTC_DEVICE_PROPERTY_IGNORE_INVALID_RAYS_ENABLED: RTCDeviceProperty = RTCDeviceProperty(
        67,
    );
    pub const RTC_DEVICE_PROPERTY_COMPACT_POLYS_ENABLED: RTCDeviceProperty = RTCDeviceProperty(
        68,
    );
    pub const RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        96,
    );
    pub const RTC_DEVICE_PROPERTY_QUAD_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        97,
    );
    pub const RTC_DEVICE_PROPERTY_SUBDIVISION_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        98,
    );
    pub const RTC_DEVICE_PROPERTY_CURVE_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        99,
    );
    pub const RTC_DEVICE_PROPERTY_USER_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        100,
    );
    pub const RTC_DEVICE_PROPERTY_POINT_GEOMETRY_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        101,
    );
    pub const RTC_DEVICE_PROPERTY_TASKING_SYSTEM: RTCDeviceProperty = RTCDeviceProperty(
        128,
    );
    pub const RTC_DEVICE_PROPERTY_JOIN_COMMIT_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        129,
    );
    pub const RTC_DEVICE_PROPERTY_PARALLEL_COMMIT_SUPPORTED: RTCDeviceProperty = RTCDeviceProperty(
        130,
    );
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCDeviceProperty(pub ::std::os::raw::c_uint);
unsafe extern "C" {
    pub fn rtcGetDeviceProperty(device: RTCDevice, prop: RTCDeviceProperty) -> isize;
}
unsafe extern "C" {
    pub fn rtcSetDeviceProperty(
        device: RTCDevice,
        prop: RTCDeviceProperty,
        value: isize,
    );
}
impl RTCError {
    pub const RTC_ERROR_NONE: RTCError = RTCError(0);
    pub const RTC_ERROR_UNKNOWN: RTCError = RTCError(1);
    pub const RTC_ERROR_INVALID_ARGUMENT: RTCError = RTCError(2);
    pub const RTC_ERROR_INVALID_OPERATION: RTCError = RTCError(3);
    pub const RTC_ERROR_OUT_OF_MEMORY: RTCError = RTCError(4);
    pub const RTC_ERROR_UNSUPPORTED_CPU: RTCError = RTCError(5);
    pub const RTC_ERROR_CANCELLED: RTCError = RTCError(6);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCError(pub ::std::os::raw::c_uint);
unsafe extern "C" {
    pub fn rtcGetDeviceError(device: RTCDevice) -> RTCError;
}
pub type RTCErrorFunction = ::std::option::Option<
    unsafe extern "C" fn(
        userPtr: *mut ::std::os::raw::c_void,
        code: RTCError,
        str_: *const ::std::os::raw::c_char,
    ),
>;
unsafe extern "C" {
    pub fn rtcSetDeviceErrorFunction(
        device: RTCDevice,
        error: RTCErrorFunction,
        userPtr: *mut ::std::os::raw::c_void,
    );
}
pub type RTCMemoryMonitorFunction = ::std::option::Option<
    unsafe extern "C" fn(
        ptr: *mut ::std::os::raw::c_void,
        bytes: isize,
        post: bool,
    ) -> bool,
>;
unsafe extern "C" {
    pub fn rtcSetDeviceMemoryMonitorFunction(
        device: RTCDevice,
        memoryMonitor: RTCMemoryMonitorFunction,
        userPtr: *mut ::std::os::raw::c_void,
    );
}
impl RTCBufferType {
    pub const RTC_BUFFER_TYPE_INDEX: RTCBufferType = RTCBufferType(0);
    pub const RTC_BUFFER_TYPE_VERTEX: RTCBufferType = RTCBufferType(1);
    pub const RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE: RTCBufferType = RTCBufferType(2);
    pub const RTC_BUFFER_TYPE_NORMAL: RTCBufferType = RTCBufferType(3);
    pub const RTC_BUFFER_TYPE_TANGENT: RTCBufferType = RTCBufferType(4);
    pub const RTC_BUFFER_TYPE_NORMAL_DERIVATIVE: RTCBufferType = RTCBufferType(5);
    pub const RTC_BUFFER_TYPE_GRID: RTCBufferType = RTCBufferType(8);
    pub const RTC_BUFFER_TYPE_FACE: RTCBufferType = RTCBufferType(16);
    pub const RTC_BUFFER_TYPE_LEVEL: RTCBufferType = RTCBufferType(17);
    pub const RTC_BUFFER_TYPE_EDGE_CREASE_INDEX: RTCBufferType = RTCBufferType(18);
    pub const RTC_BUFFER_TYPE_EDGE_CREASE_WEIGHT: RTCBufferType = RTCBufferType(19);
    pub const RTC_BUFFER_TYPE_VERTEX_CREASE_INDEX: RTCBufferType = RTCBufferType(20);
    pub const RTC_BUFFER_TYPE_VERTEX_CREASE_WEIGHT: RTCBufferType = RTCBufferType(21);
    pub const RTC_BUFFER_TYPE_HOLE: RTCBufferType = RTCBufferType(22);
    pub const RTC_BUFFER_TYPE_FLAGS: RTCBufferType = RTCBufferType(32);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCBufferType(pub ::std::os::raw::c_uint);
#[repr(C)]
#[derive(Debug)]
pub struct RTCBufferTy {
    _unused: [u8; 0],
}
pub type RTCBuffer = *mut RTCBufferTy;
unsafe extern "C" {
    pub fn rtcNewBuffer(device: RTCDevice, byteSize: usize) -> RTCBuffer;
}
unsafe extern "C" {
    pub fn rtcNewSharedBuffer(
        device: RTCDevice,
        ptr: *mut ::std::os::raw::c_void,
        byteSize: usize,
    ) -> RTCBuffer;
}
unsafe extern "C" {
    pub fn rtcGetBufferData(buffer: RTCBuffer) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcRetainBuffer(buffer: RTCBuffer);
}
unsafe extern "C" {
    pub fn rtcReleaseBuffer(buffer: RTCBuffer);
}
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRay {
    pub org_x: f32,
    pub org_y: f32,
    pub org_z: f32,
    pub tnear: f32,
    pub dir_x: f32,
    pub dir_y: f32,
    pub dir_z: f32,
    pub time: f32,
    pub tfar: f32,
    pub mask: ::std::os::raw::c_uint,
    pub id: ::std::os::raw::c_uint,
    pub flags: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRay"][::std::mem::size_of::<RTCRay>() - 48usize];
    ["Alignment of RTCRay"][::std::mem::align_of::<RTCRay>() - 16usize];
    ["Offset of field: RTCRay::org_x"][::std::mem::offset_of!(RTCRay, org_x) - 0usize];
    ["Offset of field: RTCRay::org_y"][::std::mem::offset_of!(RTCRay, org_y) - 4usize];
    ["Offset of field: RTCRay::org_z"][::std::mem::offset_of!(RTCRay, org_z) - 8usize];
    ["Offset of field: RTCRay::tnear"][::std::mem::offset_of!(RTCRay, tnear) - 12usize];
    ["Offset of field: RTCRay::dir_x"][::std::mem::offset_of!(RTCRay, dir_x) - 16usize];
    ["Offset of field: RTCRay::dir_y"][::std::mem::offset_of!(RTCRay, dir_y) - 20usize];
    ["Offset of field: RTCRay::dir_z"][::std::mem::offset_of!(RTCRay, dir_z) - 24usize];
    ["Offset of field: RTCRay::time"][::std::mem::offset_of!(RTCRay, time) - 28usize];
    ["Offset of field: RTCRay::tfar"][::std::mem::offset_of!(RTCRay, tfar) - 32usize];
    ["Offset of field: RTCRay::mask"][::std::mem::offset_of!(RTCRay, mask) - 36usize];
    ["Offset of field: RTCRay::id"][::std::mem::offset_of!(RTCRay, id) - 40usize];
    ["Offset of field: RTCRay::flags"][::std::mem::offset_of!(RTCRay, flags) - 44usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCHit {
    pub Ng_x: f32,
    pub Ng_y: f32,
    pub Ng_z: f32,
    pub u: f32,
    pub v: f32,
    pub primID: ::std::os::raw::c_uint,
    pub geomID: ::std::os::raw::c_uint,
    pub instID: [::std::os::raw::c_uint; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCHit"][::std::mem::size_of::<RTCHit>() - 32usize];
    ["Alignment of RTCHit"][::std::mem::align_of::<RTCHit>() - 16usize];
    ["Offset of field: RTCHit::Ng_x"][::std::mem::offset_of!(RTCHit, Ng_x) - 0usize];
    ["Offset of field: RTCHit::Ng_y"][::std::mem::offset_of!(RTCHit, Ng_y) - 4usize];
    ["Offset of field: RTCHit::Ng_z"][::std::mem::offset_of!(RTCHit, Ng_z) - 8usize];
    ["Offset of field: RTCHit::u"][::std::mem::offset_of!(RTCHit, u) - 12usize];
    ["Offset of field: RTCHit::v"][::std::mem::offset_of!(RTCHit, v) - 16usize];
    [
        "Offset of field: RTCHit::primID",
    ][::std::mem::offset_of!(RTCHit, primID) - 20usize];
    [
        "Offset of field: RTCHit::geomID",
    ][::std::mem::offset_of!(RTCHit, geomID) - 24usize];
    [
        "Offset of field: RTCHit::instID",
    ][::std::mem::offset_of!(RTCHit, instID) - 28usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRayHit {
    pub ray: RTCRay,
    pub hit: RTCHit,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayHit"][::std::mem::size_of::<RTCRayHit>() - 80usize];
    ["Alignment of RTCRayHit"][::std::mem::align_of::<RTCRayHit>() - 16usize];
    ["Offset of field: RTCRayHit::ray"][::std::mem::offset_of!(RTCRayHit, ray) - 0usize];
    [
        "Offset of field: RTCRayHit::hit",
    ][::std::mem::offset_of!(RTCRayHit, hit) - 48usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRay4 {
    pub org_x: [f32; 4usize],
    pub org_y: [f32; 4usize],
    pub org_z: [f32; 4usize],
    pub tnear: [f32; 4usize],
    pub dir_x: [f32; 4usize],
    pub dir_y: [f32; 4usize],
    pub dir_z: [f32; 4usize],
    pub time: [f32; 4usize],
    pub tfar: [f32; 4usize],
    pub mask: [::std::os::raw::c_uint; 4usize],
    pub id: [::std::os::raw::c_uint; 4usize],
    pub flags: [::std::os::raw::c_uint; 4usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRay4"][::std::mem::size_of::<RTCRay4>() - 192usize];
    ["Alignment of RTCRay4"][::std::mem::align_of::<RTCRay4>() - 16usize];
    ["Offset of field: RTCRay4::org_x"][::std::mem::offset_of!(RTCRay4, org_x) - 0usize];
    [
        "Offset of field: RTCRay4::org_y",
    ][::std::mem::offset_of!(RTCRay4, org_y) - 16usize];
    [
        "Offset of field: RTCRay4::org_z",
    ][::std::mem::offset_of!(RTCRay4, org_z) - 32usize];
    [
        "Offset of field: RTCRay4::tnear",
    ][::std::mem::offset_of!(RTCRay4, tnear) - 48usize];
    [
        "Offset of field: RTCRay4::dir_x",
    ][::std::mem::offset_of!(RTCRay4, dir_x) - 64usize];
    [
        "Offset of field: RTCRay4::dir_y",
    ][::std::mem::offset_of!(RTCRay4, dir_y) - 80usize];
    [
        "Offset of field: RTCRay4::dir_z",
    ][::std::mem::offset_of!(RTCRay4, dir_z) - 96usize];
    ["Offset of field: RTCRay4::time"][::std::mem::offset_of!(RTCRay4, time) - 112usize];
    ["Offset of field: RTCRay4::tfar"][::std::mem::offset_of!(RTCRay4, tfar) - 128usize];
    ["Offset of field: RTCRay4::mask"][::std::mem::offset_of!(RTCRay4, mask) - 144usize];
    ["Offset of field: RTCRay4::id"][::std::mem::offset_of!(RTCRay4, id) - 160usize];
    [
        "Offset of field: RTCRay4::flags",
    ][::std::mem::offset_of!(RTCRay4, flags) - 176usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCHit4 {
    pub Ng_x: [f32; 4usize],
    pub Ng_y: [f32; 4usize],
    pub Ng_z: [f32; 4usize],
    pub u: [f32; 4usize],
    pub v: [f32; 4usize],
    pub primID: [::std::os::raw::c_uint; 4usize],
    pub geomID: [::std::os::raw::c_uint; 4usize],
    pub instID: [[::std::os::raw::c_uint; 4usize]; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCHit4"][::std::mem::size_of::<RTCHit4>() - 128usize];
    ["Alignment of RTCHit4"][::std::mem::align_of::<RTCHit4>() - 16usize];
    ["Offset of field: RTCHit4::Ng_x"][::std::mem::offset_of!(RTCHit4, Ng_x) - 0usize];
    ["Offset of field: RTCHit4::Ng_y"][::std::mem::offset_of!(RTCHit4, Ng_y) - 16usize];
    ["Offset of field: RTCHit4::Ng_z"][::std::mem::offset_of!(RTCHit4, Ng_z) - 32usize];
    ["Offset of field: RTCHit4::u"][::std::mem::offset_of!(RTCHit4, u) - 48usize];
    ["Offset of field: RTCHit4::v"][::std::mem::offset_of!(RTCHit4, v) - 64usize];
    [
        "Offset of field: RTCHit4::primID",
    ][::std::mem::offset_of!(RTCHit4, primID) - 80usize];
    [
        "Offset of field: RTCHit4::geomID",
    ][::std::mem::offset_of!(RTCHit4, geomID) - 96usize];
    [
        "Offset of field: RTCHit4::instID",
    ][::std::mem::offset_of!(RTCHit4, instID) - 112usize];
};
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRayHit4 {
    pub ray: RTCRay4,
    pub hit: RTCHit4,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayHit4"][::std::mem::size_of::<RTCRayHit4>() - 320usize];
    ["Alignment of RTCRayHit4"][::std::mem::align_of::<RTCRayHit4>() - 16usize];
    [
        "Offset of field: RTCRayHit4::ray",
    ][::std::mem::offset_of!(RTCRayHit4, ray) - 0usize];
    [
        "Offset of field: RTCRayHit4::hit",
    ][::std::mem::offset_of!(RTCRayHit4, hit) - 192usize];
};
#[repr(C)]
#[repr(align(32))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRay8 {
    pub org_x: [f32; 8usize],
    pub org_y: [f32; 8usize],
    pub org_z: [f32; 8usize],
    pub tnear: [f32; 8usize],
    pub dir_x: [f32; 8usize],
    pub dir_y: [f32; 8usize],
    pub dir_z: [f32; 8usize],
    pub time: [f32; 8usize],
    pub tfar: [f32; 8usize],
    pub mask: [::std::os::raw::c_uint; 8usize],
    pub id: [::std::os::raw::c_uint; 8usize],
    pub flags: [::std::os::raw::c_uint; 8usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRay8"][::std::mem::size_of::<RTCRay8>() - 384usize];
    ["Alignment of RTCRay8"][::std::mem::align_of::<RTCRay8>() - 32usize];
    ["Offset of field: RTCRay8::org_x"][::std::mem::offset_of!(RTCRay8, org_x) - 0usize];
    [
        "Offset of field: RTCRay8::org_y",
    ][::std::mem::offset_of!(RTCRay8, org_y) - 32usize];
    [
        "Offset of field: RTCRay8::org_z",
    ][::std::mem::offset_of!(RTCRay8, org_z) - 64usize];
    [
        "Offset of field: RTCRay8::tnear",
    ][::std::mem::offset_of!(RTCRay8, tnear) - 96usize];
    [
        "Offset of field: RTCRay8::dir_x",
    ][::std::mem::offset_of!(RTCRay8, dir_x) - 128usize];
    [
        "Offset of field: RTCRay8::dir_y",
    ][::std::mem::offset_of!(RTCRay8, dir_y) - 160usize];
    [
        "Offset of field: RTCRay8::dir_z",
    ][::std::mem::offset_of!(RTCRay8, dir_z) - 192usize];
    ["Offset of field: RTCRay8::time"][::std::mem::offset_of!(RTCRay8, time) - 224usize];
    ["Offset of field: RTCRay8::tfar"][::std::mem::offset_of!(RTCRay8, tfar) - 256usize];
    ["Offset of field: RTCRay8::mask"][::std::mem::offset_of!(RTCRay8, mask) - 288usize];
    ["Offset of field: RTCRay8::id"][::std::mem::offset_of!(RTCRay8, id) - 320usize];
    [
        "Offset of field: RTCRay8::flags",
    ][::std::mem::offset_of!(RTCRay8, flags) - 352usize];
};
#[repr(C)]
#[repr(align(32))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCHit8 {
    pub Ng_x: [f32; 8usize],
    pub Ng_y: [f32; 8usize],
    pub Ng_z: [f32; 8usize],
    pub u: [f32; 8usize],
    pub v: [f32; 8usize],
    pub primID: [::std::os::raw::c_uint; 8usize],
    pub geomID: [::std::os::raw::c_uint; 8usize],
    pub instID: [[::std::os::raw::c_uint; 8usize]; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCHit8"][::std::mem::size_of::<RTCHit8>() - 256usize];
    ["Alignment of RTCHit8"][::std::mem::align_of::<RTCHit8>() - 32usize];
    ["Offset of field: RTCHit8::Ng_x"][::std::mem::offset_of!(RTCHit8, Ng_x) - 0usize];
    ["Offset of field: RTCHit8::Ng_y"][::std::mem::offset_of!(RTCHit8, Ng_y) - 32usize];
    ["Offset of field: RTCHit8::Ng_z"][::std::mem::offset_of!(RTCHit8, Ng_z) - 64usize];
    ["Offset of field: RTCHit8::u"][::std::mem::offset_of!(RTCHit8, u) - 96usize];
    ["Offset of field: RTCHit8::v"][::std::mem::offset_of!(RTCHit8, v) - 128usize];
    [
        "Offset of field: RTCHit8::primID",
    ][::std::mem::offset_of!(RTCHit8, primID) - 160usize];
    [
        "Offset of field: RTCHit8::geomID",
    ][::std::mem::offset_of!(RTCHit8, geomID) - 192usize];
    [
        "Offset of field: RTCHit8::instID",
    ][::std::mem::offset_of!(RTCHit8, instID) - 224usize];
};
#[repr(C)]
#[repr(align(32))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCRayHit8 {
    pub ray: RTCRay8,
    pub hit: RTCHit8,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayHit8"][::std::mem::size_of::<RTCRayHit8>() - 640usize];
    ["Alignment of RTCRayHit8"][::std::mem::align_of::<RTCRayHit8>() - 32usize];
    [
        "Offset of field: RTCRayHit8::ray",
    ][::std::mem::offset_of!(RTCRayHit8, ray) - 0usize];
    [
        "Offset of field: RTCRayHit8::hit",
    ][::std::mem::offset_of!(RTCRayHit8, hit) - 384usize];
};
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Copy, Clone)]
pub struct RTCRay16 {
    pub org_x: [f32; 16usize],
    pub org_y: [f32; 16usize],
    pub org_z: [f32; 16usize],
    pub tnear: [f32; 16usize],
    pub dir_x: [f32; 16usize],
    pub dir_y: [f32; 16usize],
    pub dir_z: [f32; 16usize],
    pub time: [f32; 16usize],
    pub tfar: [f32; 16usize],
    pub mask: [::std::os::raw::c_uint; 16usize],
    pub id: [::std::os::raw::c_uint; 16usize],
    pub flags: [::std::os::raw::c_uint; 16usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRay16"][::std::mem::size_of::<RTCRay16>() - 768usize];
    ["Alignment of RTCRay16"][::std::mem::align_of::<RTCRay16>() - 64usize];
    [
        "Offset of field: RTCRay16::org_x",
    ][::std::mem::offset_of!(RTCRay16, org_x) - 0usize];
    [
        "Offset of field: RTCRay16::org_y",
    ][::std::mem::offset_of!(RTCRay16, org_y) - 64usize];
    [
        "Offset of field: RTCRay16::org_z",
    ][::std::mem::offset_of!(RTCRay16, org_z) - 128usize];
    [
        "Offset of field: RTCRay16::tnear",
    ][::std::mem::offset_of!(RTCRay16, tnear) - 192usize];
    [
        "Offset of field: RTCRay16::dir_x",
    ][::std::mem::offset_of!(RTCRay16, dir_x) - 256usize];
    [
        "Offset of field: RTCRay16::dir_y",
    ][::std::mem::offset_of!(RTCRay16, dir_y) - 320usize];
    [
        "Offset of field: RTCRay16::dir_z",
    ][::std::mem::offset_of!(RTCRay16, dir_z) - 384usize];
    [
        "Offset of field: RTCRay16::time",
    ][::std::mem::offset_of!(RTCRay16, time) - 448usize];
    [
        "Offset of field: RTCRay16::tfar",
    ][::std::mem::offset_of!(RTCRay16, tfar) - 512usize];
    [
        "Offset of field: RTCRay16::mask",
    ][::std::mem::offset_of!(RTCRay16, mask) - 576usize];
    ["Offset of field: RTCRay16::id"][::std::mem::offset_of!(RTCRay16, id) - 640usize];
    [
        "Offset of field: RTCRay16::flags",
    ][::std::mem::offset_of!(RTCRay16, flags) - 704usize];
};
impl Default for RTCRay16 {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Copy, Clone)]
pub struct RTCHit16 {
    pub Ng_x: [f32; 16usize],
    pub Ng_y: [f32; 16usize],
    pub Ng_z: [f32; 16usize],
    pub u: [f32; 16usize],
    pub v: [f32; 16usize],
    pub primID: [::std::os::raw::c_uint; 16usize],
    pub geomID: [::std::os::raw::c_uint; 16usize],
    pub instID: [[::std::os::raw::c_uint; 16usize]; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCHit16"][::std::mem::size_of::<RTCHit16>() - 512usize];
    ["Alignment of RTCHit16"][::std::mem::align_of::<RTCHit16>() - 64usize];
    ["Offset of field: RTCHit16::Ng_x"][::std::mem::offset_of!(RTCHit16, Ng_x) - 0usize];
    [
        "Offset of field: RTCHit16::Ng_y",
    ][::std::mem::offset_of!(RTCHit16, Ng_y) - 64usize];
    [
        "Offset of field: RTCHit16::Ng_z",
    ][::std::mem::offset_of!(RTCHit16, Ng_z) - 128usize];
    ["Offset of field: RTCHit16::u"][::std::mem::offset_of!(RTCHit16, u) - 192usize];
    ["Offset of field: RTCHit16::v"][::std::mem::offset_of!(RTCHit16, v) - 256usize];
    [
        "Offset of field: RTCHit16::primID",
    ][::std::mem::offset_of!(RTCHit16, primID) - 320usize];
    [
        "Offset of field: RTCHit16::geomID",
    ][::std::mem::offset_of!(RTCHit16, geomID) - 384usize];
    [
        "Offset of field: RTCHit16::instID",
    ][::std::mem::offset_of!(RTCHit16, instID) - 448usize];
};
impl Default for RTCHit16 {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Copy, Clone)]
pub struct RTCRayHit16 {
    pub ray: RTCRay16,
    pub hit: RTCHit16,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayHit16"][::std::mem::size_of::<RTCRayHit16>() - 1280usize];
    ["Alignment of RTCRayHit16"][::std::mem::align_of::<RTCRayHit16>() - 64usize];
    [
        "Offset of field: RTCRayHit16::ray",
    ][::std::mem::offset_of!(RTCRayHit16, ray) - 0usize];
    [
        "Offset of field: RTCRayHit16::hit",
    ][::std::mem::offset_of!(RTCRayHit16, hit) - 768usize];
};
impl Default for RTCRayHit16 {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCRayNp {
    pub org_x: *mut f32,
    pub org_y: *mut f32,
    pub org_z: *mut f32,
    pub tnear: *mut f32,
    pub dir_x: *mut f32,
    pub dir_y: *mut f32,
    pub dir_z: *mut f32,
    pub time: *mut f32,
    pub tfar: *mut f32,
    pub mask: *mut ::std::os::raw::c_uint,
    pub id: *mut ::std::os::raw::c_uint,
    pub flags: *mut ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayNp"][::std::mem::size_of::<RTCRayNp>() - 96usize];
    ["Alignment of RTCRayNp"][::std::mem::align_of::<RTCRayNp>() - 8usize];
    [
        "Offset of field: RTCRayNp::org_x",
    ][::std::mem::offset_of!(RTCRayNp, org_x) - 0usize];
    [
        "Offset of field: RTCRayNp::org_y",
    ][::std::mem::offset_of!(RTCRayNp, org_y) - 8usize];
    [
        "Offset of field: RTCRayNp::org_z",
    ][::std::mem::offset_of!(RTCRayNp, org_z) - 16usize];
    [
        "Offset of field: RTCRayNp::tnear",
    ][::std::mem::offset_of!(RTCRayNp, tnear) - 24usize];
    [
        "Offset of field: RTCRayNp::dir_x",
    ][::std::mem::offset_of!(RTCRayNp, dir_x) - 32usize];
    [
        "Offset of field: RTCRayNp::dir_y",
    ][::std::mem::offset_of!(RTCRayNp, dir_y) - 40usize];
    [
        "Offset of field: RTCRayNp::dir_z",
    ][::std::mem::offset_of!(RTCRayNp, dir_z) - 48usize];
    [
        "Offset of field: RTCRayNp::time",
    ][::std::mem::offset_of!(RTCRayNp, time) - 56usize];
    [
        "Offset of field: RTCRayNp::tfar",
    ][::std::mem::offset_of!(RTCRayNp, tfar) - 64usize];
    [
        "Offset of field: RTCRayNp::mask",
    ][::std::mem::offset_of!(RTCRayNp, mask) - 72usize];
    ["Offset of field: RTCRayNp::id"][::std::mem::offset_of!(RTCRayNp, id) - 80usize];
    [
        "Offset of field: RTCRayNp::flags",
    ][::std::mem::offset_of!(RTCRayNp, flags) - 88usize];
};
impl Default for RTCRayNp {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCHitNp {
    pub Ng_x: *mut f32,
    pub Ng_y: *mut f32,
    pub Ng_z: *mut f32,
    pub u: *mut f32,
    pub v: *mut f32,
    pub primID: *mut ::std::os::raw::c_uint,
    pub geomID: *mut ::std::os::raw::c_uint,
    pub instID: [*mut ::std::os::raw::c_uint; 1usize],
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCHitNp"][::std::mem::size_of::<RTCHitNp>() - 64usize];
    ["Alignment of RTCHitNp"][::std::mem::align_of::<RTCHitNp>() - 8usize];
    ["Offset of field: RTCHitNp::Ng_x"][::std::mem::offset_of!(RTCHitNp, Ng_x) - 0usize];
    ["Offset of field: RTCHitNp::Ng_y"][::std::mem::offset_of!(RTCHitNp, Ng_y) - 8usize];
    [
        "Offset of field: RTCHitNp::Ng_z",
    ][::std::mem::offset_of!(RTCHitNp, Ng_z) - 16usize];
    ["Offset of field: RTCHitNp::u"][::std::mem::offset_of!(RTCHitNp, u) - 24usize];
    ["Offset of field: RTCHitNp::v"][::std::mem::offset_of!(RTCHitNp, v) - 32usize];
    [
        "Offset of field: RTCHitNp::primID",
    ][::std::mem::offset_of!(RTCHitNp, primID) - 40usize];
    [
        "Offset of field: RTCHitNp::geomID",
    ][::std::mem::offset_of!(RTCHitNp, geomID) - 48usize];
    [
        "Offset of field: RTCHitNp::instID",
    ][::std::mem::offset_of!(RTCHitNp, instID) - 56usize];
};
impl Default for RTCHitNp {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCRayHitNp {
    pub ray: RTCRayNp,
    pub hit: RTCHitNp,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCRayHitNp"][::std::mem::size_of::<RTCRayHitNp>() - 160usize];
    ["Alignment of RTCRayHitNp"][::std::mem::align_of::<RTCRayHitNp>() - 8usize];
    [
        "Offset of field: RTCRayHitNp::ray",
    ][::std::mem::offset_of!(RTCRayHitNp, ray) - 0usize];
    [
        "Offset of field: RTCRayHitNp::hit",
    ][::std::mem::offset_of!(RTCRayHitNp, hit) - 96usize];
};
impl Default for RTCRayHitNp {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
#[repr(C)]
#[derive(Debug)]
pub struct RTCRayN {
    _unused: [u8; 0],
}
#[repr(C)]
#[derive(Debug)]
pub struct RTCHitN {
    _unused: [u8; 0],
}
#[repr(C)]
#[derive(Debug)]
pub struct RTCRayHitN {
    _unused: [u8; 0],
}
#[repr(C)]
#[repr(align(16))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCQuaternionDecomposition {
    pub scale_x: f32,
    pub scale_y: f32,
    pub scale_z: f32,
    pub skew_xy: f32,
    pub skew_xz: f32,
    pub skew_yz: f32,
    pub shift_x: f32,
    pub shift_y: f32,
    pub shift_z: f32,
    pub quaternion_r: f32,
    pub quaternion_i: f32,
    pub quaternion_j: f32,
    pub quaternion_k: f32,
    pub translation_x: f32,
    pub translation_y: f32,
    pub translation_z: f32,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCQuaternionDecomposition",
    ][::std::mem::size_of::<RTCQuaternionDecomposition>() - 64usize];
    [
        "Alignment of RTCQuaternionDecomposition",
    ][::std::mem::align_of::<RTCQuaternionDecomposition>() - 16usize];
    [
        "Offset of field: RTCQuaternionDecomposition::scale_x",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, scale_x) - 0usize];
    [
        "Offset of field: RTCQuaternionDecomposition::scale_y",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, scale_y) - 4usize];
    [
        "Offset of field: RTCQuaternionDecomposition::scale_z",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, scale_z) - 8usize];
    [
        "Offset of field: RTCQuaternionDecomposition::skew_xy",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, skew_xy) - 12usize];
    [
        "Offset of field: RTCQuaternionDecomposition::skew_xz",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, skew_xz) - 16usize];
    [
        "Offset of field: RTCQuaternionDecomposition::skew_yz",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, skew_yz) - 20usize];
    [
        "Offset of field: RTCQuaternionDecomposition::shift_x",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, shift_x) - 24usize];
    [
        "Offset of field: RTCQuaternionDecomposition::shift_y",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, shift_y) - 28usize];
    [
        "Offset of field: RTCQuaternionDecomposition::shift_z",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, shift_z) - 32usize];
    [
        "Offset of field: RTCQuaternionDecomposition::quaternion_r",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, quaternion_r) - 36usize];
    [
        "Offset of field: RTCQuaternionDecomposition::quaternion_i",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, quaternion_i) - 40usize];
    [
        "Offset of field: RTCQuaternionDecomposition::quaternion_j",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, quaternion_j) - 44usize];
    [
        "Offset of field: RTCQuaternionDecomposition::quaternion_k",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, quaternion_k) - 48usize];
    [
        "Offset of field: RTCQuaternionDecomposition::translation_x",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, translation_x) - 52usize];
    [
        "Offset of field: RTCQuaternionDecomposition::translation_y",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, translation_y) - 56usize];
    [
        "Offset of field: RTCQuaternionDecomposition::translation_z",
    ][::std::mem::offset_of!(RTCQuaternionDecomposition, translation_z) - 60usize];
};
#[repr(C)]
#[derive(Debug)]
pub struct RTCSceneTy {
    _unused: [u8; 0],
}
pub type RTCScene = *mut RTCSceneTy;
#[repr(C)]
#[derive(Debug)]
pub struct RTCGeometryTy {
    _unused: [u8; 0],
}
pub type RTCGeometry = *mut RTCGeometryTy;
impl RTCGeometryType {
    pub const RTC_GEOMETRY_TYPE_TRIANGLE: RTCGeometryType = RTCGeometryType(0);
    pub const RTC_GEOMETRY_TYPE_QUAD: RTCGeometryType = RTCGeometryType(1);
    pub const RTC_GEOMETRY_TYPE_GRID: RTCGeometryType = RTCGeometryType(2);
    pub const RTC_GEOMETRY_TYPE_SUBDIVISION: RTCGeometryType = RTCGeometryType(8);
    pub const RTC_GEOMETRY_TYPE_CONE_LINEAR_CURVE: RTCGeometryType = RTCGeometryType(15);
    pub const RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE: RTCGeometryType = RTCGeometryType(
        16,
    );
    pub const RTC_GEOMETRY_TYPE_FLAT_LINEAR_CURVE: RTCGeometryType = RTCGeometryType(17);
    pub const RTC_GEOMETRY_TYPE_ROUND_BEZIER_CURVE: RTCGeometryType = RTCGeometryType(
        24,
    );
    pub const RTC_GEOMETRY_TYPE_FLAT_BEZIER_CURVE: RTCGeometryType = RTCGeometryType(25);
    pub const RTC_GEOMETRY_TYPE_NORMAL_ORIENTED_BEZIER_CURVE: RTCGeometryType = RTCGeometryType(
        26,
    );
    pub const RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE: RTCGeometryType = RTCGeometryType(
        32,
    );
    pub const RTC_GEOMETRY_TYPE_FLAT_BSPLINE_CURVE: RTCGeometryType = RTCGeometryType(
        33,
    );
    pub const RTC_GEOMETRY_TYPE_NORMAL_ORIENTED_BSPLINE_CURVE: RTCGeometryType = RTCGeometryType(
        34,
    );
    pub const RTC_GEOMETRY_TYPE_ROUND_HERMITE_CURVE: RTCGeometryType = RTCGeometryType(
        40,
    );
    pub const RTC_GEOMETRY_TYPE_FLAT_HERMITE_CURVE: RTCGeometryType = RTCGeometryType(
        41,
    );
    pub const RTC_GEOMETRY_TYPE_NORMAL_ORIENTED_HERMITE_CURVE: RTCGeometryType = RTCGeometryType(
        42,
    );
    pub const RTC_GEOMETRY_TYPE_SPHERE_POINT: RTCGeometryType = RTCGeometryType(50);
    pub const RTC_GEOMETRY_TYPE_DISC_POINT: RTCGeometryType = RTCGeometryType(51);
    pub const RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT: RTCGeometryType = RTCGeometryType(
        52,
    );
    pub const RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE: RTCGeometryType = RTCGeometryType(
        58,
    );
    pub const RTC_GEOMETRY_TYPE_FLAT_CATMULL_ROM_CURVE: RTCGeometryType = RTCGeometryType(
        59,
    );
    pub const RTC_GEOMETRY_TYPE_NORMAL_ORIENTED_CATMULL_ROM_CURVE: RTCGeometryType = RTCGeometryType(
        60,
    );
    pub const RTC_GEOMETRY_TYPE_USER: RTCGeometryType = RTCGeometryType(120);
    pub const RTC_GEOMETRY_TYPE_INSTANCE: RTCGeometryType = RTCGeometryType(121);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCGeometryType(pub ::std::os::raw::c_uint);
impl RTCSubdivisionMode {
    pub const RTC_SUBDIVISION_MODE_NO_BOUNDARY: RTCSubdivisionMode = RTCSubdivisionMode(
        0,
    );
    pub const RTC_SUBDIVISION_MODE_SMOOTH_BOUNDARY: RTCSubdivisionMode = RTCSubdivisionMode(
        1,
    );
    pub const RTC_SUBDIVISION_MODE_PIN_CORNERS: RTCSubdivisionMode = RTCSubdivisionMode(
        2,
    );
    pub const RTC_SUBDIVISION_MODE_PIN_BOUNDARY: RTCSubdivisionMode = RTCSubdivisionMode(
        3,
    );
    pub const RTC_SUBDIVISION_MODE_PIN_ALL: RTCSubdivisionMode = RTCSubdivisionMode(4);
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCSubdivisionMode(pub ::std::os::raw::c_uint);
impl RTCCurveFlags {
    pub const RTC_CURVE_FLAG_NEIGHBOR_LEFT: RTCCurveFlags = RTCCurveFlags(1);
    pub const RTC_CURVE_FLAG_NEIGHBOR_RIGHT: RTCCurveFlags = RTCCurveFlags(2);
}
impl ::std::ops::BitOr<RTCCurveFlags> for RTCCurveFlags {
    type Output = Self;
    #[inline]
    fn bitor(self, other: Self) -> Self {
        RTCCurveFlags(self.0 | other.0)
    }
}
impl ::std::ops::BitOrAssign for RTCCurveFlags {
    #[inline]
    fn bitor_assign(&mut self, rhs: RTCCurveFlags) {
        self.0 |= rhs.0;
    }
}
impl ::std::ops::BitAnd<RTCCurveFlags> for RTCCurveFlags {
    type Output = Self;
    #[inline]
    fn bitand(self, other: Self) -> Self {
        RTCCurveFlags(self.0 & other.0)
    }
}
impl ::std::ops::BitAndAssign for RTCCurveFlags {
    #[inline]
    fn bitand_assign(&mut self, rhs: RTCCurveFlags) {
        self.0 &= rhs.0;
    }
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCCurveFlags(pub ::std::os::raw::c_uint);
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCBoundsFunctionArguments {
    pub geometryUserPtr: *mut ::std::os::raw::c_void,
    pub primID: ::std::os::raw::c_uint,
    pub timeStep: ::std::os::raw::c_uint,
    pub bounds_o: *mut RTCBounds,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCBoundsFunctionArguments",
    ][::std::mem::size_of::<RTCBoundsFunctionArguments>() - 24usize];
    [
        "Alignment of RTCBoundsFunctionArguments",
    ][::std::mem::align_of::<RTCBoundsFunctionArguments>() - 8usize];
    [
        "Offset of field: RTCBoundsFunctionArguments::geometryUserPtr",
    ][::std::mem::offset_of!(RTCBoundsFunctionArguments, geometryUserPtr) - 0usize];
    [
        "Offset of field: RTCBoundsFunctionArguments::primID",
    ][::std::mem::offset_of!(RTCBoundsFunctionArguments, primID) - 8usize];
    [
        "Offset of field: RTCBoundsFunctionArguments::timeStep",
    ][::std::mem::offset_of!(RTCBoundsFunctionArguments, timeStep) - 12usize];
    [
        "Offset of field: RTCBoundsFunctionArguments::bounds_o",
    ][::std::mem::offset_of!(RTCBoundsFunctionArguments, bounds_o) - 16usize];
};
impl Default for RTCBoundsFunctionArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCBoundsFunction = ::std::option::Option<
    unsafe extern "C" fn(args: *const RTCBoundsFunctionArguments),
>;
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCIntersectFunctionNArguments {
    pub valid: *mut ::std::os::raw::c_int,
    pub geometryUserPtr: *mut ::std::os::raw::c_void,
    pub primID: ::std::os::raw::c_uint,
    pub context: *mut RTCIntersectContext,
    pub rayhit: *mut RTCRayHitN,
    pub N: ::std::os::raw::c_uint,
    pub geomID: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCIntersectFunctionNArguments",
    ][::std::mem::size_of::<RTCIntersectFunctionNArguments>() - 48usize];
    [
        "Alignment of RTCIntersectFunctionNArguments",
    ][::std::mem::align_of::<RTCIntersectFunctionNArguments>() - 8usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::valid",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, valid) - 0usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::geometryUserPtr",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, geometryUserPtr) - 8usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::primID",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, primID) - 16usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::context",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, context) - 24usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::rayhit",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, rayhit) - 32usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::N",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, N) - 40usize];
    [
        "Offset of field: RTCIntersectFunctionNArguments::geomID",
    ][::std::mem::offset_of!(RTCIntersectFunctionNArguments, geomID) - 44usize];
};
impl Default for RTCIntersectFunctionNArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCIntersectFunctionN = ::std::option::Option<
    unsafe extern "C" fn(args: *const RTCIntersectFunctionNArguments),
>;
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCOccludedFunctionNArguments {
    pub valid: *mut ::std::os::raw::c_int,
    pub geometryUserPtr: *mut ::std::os::raw::c_void,
    pub primID: ::std::os::raw::c_uint,
    pub context: *mut RTCIntersectContext,
    pub ray: *mut RTCRayN,
    pub N: ::std::os::raw::c_uint,
    pub geomID: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCOccludedFunctionNArguments",
    ][::std::mem::size_of::<RTCOccludedFunctionNArguments>() - 48usize];
    [
        "Alignment of RTCOccludedFunctionNArguments",
    ][::std::mem::align_of::<RTCOccludedFunctionNArguments>() - 8usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::valid",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, valid) - 0usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::geometryUserPtr",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, geometryUserPtr) - 8usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::primID",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, primID) - 16usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::context",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, context) - 24usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::ray",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, ray) - 32usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::N",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, N) - 40usize];
    [
        "Offset of field: RTCOccludedFunctionNArguments::geomID",
    ][::std::mem::offset_of!(RTCOccludedFunctionNArguments, geomID) - 44usize];
};
impl Default for RTCOccludedFunctionNArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCOccludedFunctionN = ::std::option::Option<
    unsafe extern "C" fn(args: *const RTCOccludedFunctionNArguments),
>;
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCDisplacementFunctionNArguments {
    pub geometryUserPtr: *mut ::std::os::raw::c_void,
    pub geometry: RTCGeometry,
    pub primID: ::std::os::raw::c_uint,
    pub timeStep: ::std::os::raw::c_uint,
    pub u: *const f32,
    pub v: *const f32,
    pub Ng_x: *const f32,
    pub Ng_y: *const f32,
    pub Ng_z: *const f32,
    pub P_x: *mut f32,
    pub P_y: *mut f32,
    pub P_z: *mut f32,
    pub N: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCDisplacementFunctionNArguments",
    ][::std::mem::size_of::<RTCDisplacementFunctionNArguments>() - 96usize];
    [
        "Alignment of RTCDisplacementFunctionNArguments",
    ][::std::mem::align_of::<RTCDisplacementFunctionNArguments>() - 8usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::geometryUserPtr",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, geometryUserPtr)
        - 0usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::geometry",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, geometry) - 8usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::primID",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, primID) - 16usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::timeStep",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, timeStep) - 20usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::u",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, u) - 24usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::v",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, v) - 32usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::Ng_x",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, Ng_x) - 40usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::Ng_y",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, Ng_y) - 48usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::Ng_z",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, Ng_z) - 56usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::P_x",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, P_x) - 64usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::P_y",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, P_y) - 72usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::P_z",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, P_z) - 80usize];
    [
        "Offset of field: RTCDisplacementFunctionNArguments::N",
    ][::std::mem::offset_of!(RTCDisplacementFunctionNArguments, N) - 88usize];
};
impl Default for RTCDisplacementFunctionNArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
pub type RTCDisplacementFunctionN = ::std::option::Option<
    unsafe extern "C" fn(args: *const RTCDisplacementFunctionNArguments),
>;
unsafe extern "C" {
    pub fn rtcNewGeometry(device: RTCDevice, type_: RTCGeometryType) -> RTCGeometry;
}
unsafe extern "C" {
    pub fn rtcRetainGeometry(geometry: RTCGeometry);
}
unsafe extern "C" {
    pub fn rtcReleaseGeometry(geometry: RTCGeometry);
}
unsafe extern "C" {
    pub fn rtcCommitGeometry(geometry: RTCGeometry);
}
unsafe extern "C" {
    pub fn rtcEnableGeometry(geometry: RTCGeometry);
}
unsafe extern "C" {
    pub fn rtcDisableGeometry(geometry: RTCGeometry);
}
unsafe extern "C" {
    pub fn rtcSetGeometryTimeStepCount(
        geometry: RTCGeometry,
        timeStepCount: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryTimeRange(geometry: RTCGeometry, startTime: f32, endTime: f32);
}
unsafe extern "C" {
    pub fn rtcSetGeometryVertexAttributeCount(
        geometry: RTCGeometry,
        vertexAttributeCount: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryMask(geometry: RTCGeometry, mask: ::std::os::raw::c_uint);
}
unsafe extern "C" {
    pub fn rtcSetGeometryBuildQuality(geometry: RTCGeometry, quality: RTCBuildQuality);
}
unsafe extern "C" {
    pub fn rtcSetGeometryMaxRadiusScale(geometry: RTCGeometry, maxRadiusScale: f32);
}
unsafe extern "C" {
    pub fn rtcSetGeometryBuffer(
        geometry: RTCGeometry,
        type_: RTCBufferType,
        slot: ::std::os::raw::c_uint,
        format: RTCFormat,
        buffer: RTCBuffer,
        byteOffset: usize,
        byteStride: usize,
        itemCount: usize,
    );
}
unsafe extern "C" {
    pub fn rtcSetSharedGeometryBuffer(
        geometry: RTCGeometry,
        type_: RTCBufferType,
        slot: ::std::os::raw::c_uint,
        format: RTCFormat,
        ptr: *const ::std::os::raw::c_void,
        byteOffset: usize,
        byteStride: usize,
        itemCount: usize,
    );
}
unsafe extern "C" {
    pub fn rtcSetNewGeometryBuffer(
        geometry: RTCGeometry,
        type_: RTCBufferType,
        slot: ::std::os::raw::c_uint,
        format: RTCFormat,
        byteStride: usize,
        itemCount: usize,
    ) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcGetGeometryBufferData(
        geometry: RTCGeometry,
        type_: RTCBufferType,
        slot: ::std::os::raw::c_uint,
    ) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcUpdateGeometryBuffer(
        geometry: RTCGeometry,
        type_: RTCBufferType,
        slot: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryIntersectFilterFunction(
        geometry: RTCGeometry,
        filter: RTCFilterFunctionN,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryOccludedFilterFunction(
        geometry: RTCGeometry,
        filter: RTCFilterFunctionN,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryUserData(
        geometry: RTCGeometry,
        ptr: *mut ::std::os::raw::c_void,
    );
}
unsafe extern "C" {
    pub fn rtcGetGeometryUserData(geometry: RTCGeometry) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcSetGeometryPointQueryFunction(
        geometry: RTCGeometry,
        pointQuery: RTCPointQueryFunction,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryUserPrimitiveCount(
        geometry: RTCGeometry,
        userPrimitiveCount: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryBoundsFunction(
        geometry: RTCGeometry,
        bounds: RTCBoundsFunction,
        userPtr: *mut ::std::os::raw::c_void,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryIntersectFunction(
        geometry: RTCGeometry,
        intersect: RTCIntersectFunctionN,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryOccludedFunction(
        geometry: RTCGeometry,
        occluded: RTCOccludedFunctionN,
    );
}
unsafe extern "C" {
    pub fn rtcFilterIntersection(
        args: *const RTCIntersectFunctionNArguments,
        filterArgs: *const RTCFilterFunctionNArguments,
    );
}
unsafe extern "C" {
    pub fn rtcFilterOcclusion(
        args: *const RTCOccludedFunctionNArguments,
        filterArgs: *const RTCFilterFunctionNArguments,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryInstancedScene(geometry: RTCGeometry, scene: RTCScene);
}
unsafe extern "C" {
    pub fn rtcSetGeometryTransform(
        geometry: RTCGeometry,
        timeStep: ::std::os::raw::c_uint,
        format: RTCFormat,
        xfm: *const ::std::os::raw::c_void,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryTransformQuaternion(
        geometry: RTCGeometry,
        timeStep: ::std::os::raw::c_uint,
        qd: *const RTCQuaternionDecomposition,
    );
}
unsafe extern "C" {
    pub fn rtcGetGeometryTransform(
        geometry: RTCGeometry,
        time: f32,
        format: RTCFormat,
        xfm: *mut ::std::os::raw::c_void,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryTessellationRate(geometry: RTCGeometry, tessellationRate: f32);
}
unsafe extern "C" {
    pub fn rtcSetGeometryTopologyCount(
        geometry: RTCGeometry,
        topologyCount: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometrySubdivisionMode(
        geometry: RTCGeometry,
        topologyID: ::std::os::raw::c_uint,
        mode: RTCSubdivisionMode,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryVertexAttributeTopology(
        geometry: RTCGeometry,
        vertexAttributeID: ::std::os::raw::c_uint,
        topologyID: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcSetGeometryDisplacementFunction(
        geometry: RTCGeometry,
        displacement: RTCDisplacementFunctionN,
    );
}
unsafe extern "C" {
    pub fn rtcGetGeometryFirstHalfEdge(
        geometry: RTCGeometry,
        faceID: ::std::os::raw::c_uint,
    ) -> ::std::os::raw::c_uint;
}
unsafe extern "C" {
    pub fn rtcGetGeometryFace(
        geometry: RTCGeometry,
        edgeID: ::std::os::raw::c_uint,
    ) -> ::std::os::raw::c_uint;
}
unsafe extern "C" {
    pub fn rtcGetGeometryNextHalfEdge(
        geometry: RTCGeometry,
        edgeID: ::std::os::raw::c_uint,
    ) -> ::std::os::raw::c_uint;
}
unsafe extern "C" {
    pub fn rtcGetGeometryPreviousHalfEdge(
        geometry: RTCGeometry,
        edgeID: ::std::os::raw::c_uint,
    ) -> ::std::os::raw::c_uint;
}
unsafe extern "C" {
    pub fn rtcGetGeometryOppositeHalfEdge(
        geometry: RTCGeometry,
        topologyID: ::std::os::raw::c_uint,
        edgeID: ::std::os::raw::c_uint,
    ) -> ::std::os::raw::c_uint;
}
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCInterpolateArguments {
    pub geometry: RTCGeometry,
    pub primID: ::std::os::raw::c_uint,
    pub u: f32,
    pub v: f32,
    pub bufferType: RTCBufferType,
    pub bufferSlot: ::std::os::raw::c_uint,
    pub P: *mut f32,
    pub dPdu: *mut f32,
    pub dPdv: *mut f32,
    pub ddPdudu: *mut f32,
    pub ddPdvdv: *mut f32,
    pub ddPdudv: *mut f32,
    pub valueCount: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCInterpolateArguments",
    ][::std::mem::size_of::<RTCInterpolateArguments>() - 88usize];
    [
        "Alignment of RTCInterpolateArguments",
    ][::std::mem::align_of::<RTCInterpolateArguments>() - 8usize];
    [
        "Offset of field: RTCInterpolateArguments::geometry",
    ][::std::mem::offset_of!(RTCInterpolateArguments, geometry) - 0usize];
    [
        "Offset of field: RTCInterpolateArguments::primID",
    ][::std::mem::offset_of!(RTCInterpolateArguments, primID) - 8usize];
    [
        "Offset of field: RTCInterpolateArguments::u",
    ][::std::mem::offset_of!(RTCInterpolateArguments, u) - 12usize];
    [
        "Offset of field: RTCInterpolateArguments::v",
    ][::std::mem::offset_of!(RTCInterpolateArguments, v) - 16usize];
    [
        "Offset of field: RTCInterpolateArguments::bufferType",
    ][::std::mem::offset_of!(RTCInterpolateArguments, bufferType) - 20usize];
    [
        "Offset of field: RTCInterpolateArguments::bufferSlot",
    ][::std::mem::offset_of!(RTCInterpolateArguments, bufferSlot) - 24usize];
    [
        "Offset of field: RTCInterpolateArguments::P",
    ][::std::mem::offset_of!(RTCInterpolateArguments, P) - 32usize];
    [
        "Offset of field: RTCInterpolateArguments::dPdu",
    ][::std::mem::offset_of!(RTCInterpolateArguments, dPdu) - 40usize];
    [
        "Offset of field: RTCInterpolateArguments::dPdv",
    ][::std::mem::offset_of!(RTCInterpolateArguments, dPdv) - 48usize];
    [
        "Offset of field: RTCInterpolateArguments::ddPdudu",
    ][::std::mem::offset_of!(RTCInterpolateArguments, ddPdudu) - 56usize];
    [
        "Offset of field: RTCInterpolateArguments::ddPdvdv",
    ][::std::mem::offset_of!(RTCInterpolateArguments, ddPdvdv) - 64usize];
    [
        "Offset of field: RTCInterpolateArguments::ddPdudv",
    ][::std::mem::offset_of!(RTCInterpolateArguments, ddPdudv) - 72usize];
    [
        "Offset of field: RTCInterpolateArguments::valueCount",
    ][::std::mem::offset_of!(RTCInterpolateArguments, valueCount) - 80usize];
};
impl Default for RTCInterpolateArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
unsafe extern "C" {
    pub fn rtcInterpolate(args: *const RTCInterpolateArguments);
}
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCInterpolateNArguments {
    pub geometry: RTCGeometry,
    pub valid: *const ::std::os::raw::c_void,
    pub primIDs: *const ::std::os::raw::c_uint,
    pub u: *const f32,
    pub v: *const f32,
    pub N: ::std::os::raw::c_uint,
    pub bufferType: RTCBufferType,
    pub bufferSlot: ::std::os::raw::c_uint,
    pub P: *mut f32,
    pub dPdu: *mut f32,
    pub dPdv: *mut f32,
    pub ddPdudu: *mut f32,
    pub ddPdvdv: *mut f32,
    pub ddPdudv: *mut f32,
    pub valueCount: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    [
        "Size of RTCInterpolateNArguments",
    ][::std::mem::size_of::<RTCInterpolateNArguments>() - 112usize];
    [
        "Alignment of RTCInterpolateNArguments",
    ][::std::mem::align_of::<RTCInterpolateNArguments>() - 8usize];
    [
        "Offset of field: RTCInterpolateNArguments::geometry",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, geometry) - 0usize];
    [
        "Offset of field: RTCInterpolateNArguments::valid",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, valid) - 8usize];
    [
        "Offset of field: RTCInterpolateNArguments::primIDs",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, primIDs) - 16usize];
    [
        "Offset of field: RTCInterpolateNArguments::u",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, u) - 24usize];
    [
        "Offset of field: RTCInterpolateNArguments::v",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, v) - 32usize];
    [
        "Offset of field: RTCInterpolateNArguments::N",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, N) - 40usize];
    [
        "Offset of field: RTCInterpolateNArguments::bufferType",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, bufferType) - 44usize];
    [
        "Offset of field: RTCInterpolateNArguments::bufferSlot",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, bufferSlot) - 48usize];
    [
        "Offset of field: RTCInterpolateNArguments::P",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, P) - 56usize];
    [
        "Offset of field: RTCInterpolateNArguments::dPdu",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, dPdu) - 64usize];
    [
        "Offset of field: RTCInterpolateNArguments::dPdv",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, dPdv) - 72usize];
    [
        "Offset of field: RTCInterpolateNArguments::ddPdudu",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, ddPdudu) - 80usize];
    [
        "Offset of field: RTCInterpolateNArguments::ddPdvdv",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, ddPdvdv) - 88usize];
    [
        "Offset of field: RTCInterpolateNArguments::ddPdudv",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, ddPdudv) - 96usize];
    [
        "Offset of field: RTCInterpolateNArguments::valueCount",
    ][::std::mem::offset_of!(RTCInterpolateNArguments, valueCount) - 104usize];
};
impl Default for RTCInterpolateNArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
unsafe extern "C" {
    pub fn rtcInterpolateN(args: *const RTCInterpolateNArguments);
}
#[repr(C)]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCGrid {
    pub startVertexID: ::std::os::raw::c_uint,
    pub stride: ::std::os::raw::c_uint,
    pub width: ::std::os::raw::c_ushort,
    pub height: ::std::os::raw::c_ushort,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCGrid"][::std::mem::size_of::<RTCGrid>() - 12usize];
    ["Alignment of RTCGrid"][::std::mem::align_of::<RTCGrid>() - 4usize];
    [
        "Offset of field: RTCGrid::startVertexID",
    ][::std::mem::offset_of!(RTCGrid, startVertexID) - 0usize];
    [
        "Offset of field: RTCGrid::stride",
    ][::std::mem::offset_of!(RTCGrid, stride) - 4usize];
    ["Offset of field: RTCGrid::width"][::std::mem::offset_of!(RTCGrid, width) - 8usize];
    [
        "Offset of field: RTCGrid::height",
    ][::std::mem::offset_of!(RTCGrid, height) - 10usize];
};
impl RTCSceneFlags {
    pub const RTC_SCENE_FLAG_NONE: RTCSceneFlags = RTCSceneFlags(0);
    pub const RTC_SCENE_FLAG_DYNAMIC: RTCSceneFlags = RTCSceneFlags(1);
    pub const RTC_SCENE_FLAG_COMPACT: RTCSceneFlags = RTCSceneFlags(2);
    pub const RTC_SCENE_FLAG_ROBUST: RTCSceneFlags = RTCSceneFlags(4);
    pub const RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION: RTCSceneFlags = RTCSceneFlags(8);
}
impl ::std::ops::BitOr<RTCSceneFlags> for RTCSceneFlags {
    type Output = Self;
    #[inline]
    fn bitor(self, other: Self) -> Self {
        RTCSceneFlags(self.0 | other.0)
    }
}
impl ::std::ops::BitOrAssign for RTCSceneFlags {
    #[inline]
    fn bitor_assign(&mut self, rhs: RTCSceneFlags) {
        self.0 |= rhs.0;
    }
}
impl ::std::ops::BitAnd<RTCSceneFlags> for RTCSceneFlags {
    type Output = Self;
    #[inline]
    fn bitand(self, other: Self) -> Self {
        RTCSceneFlags(self.0 & other.0)
    }
}
impl ::std::ops::BitAndAssign for RTCSceneFlags {
    #[inline]
    fn bitand_assign(&mut self, rhs: RTCSceneFlags) {
        self.0 &= rhs.0;
    }
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCSceneFlags(pub ::std::os::raw::c_uint);
unsafe extern "C" {
    pub fn rtcNewScene(device: RTCDevice) -> RTCScene;
}
unsafe extern "C" {
    pub fn rtcGetSceneDevice(hscene: RTCScene) -> RTCDevice;
}
unsafe extern "C" {
    pub fn rtcRetainScene(scene: RTCScene);
}
unsafe extern "C" {
    pub fn rtcReleaseScene(scene: RTCScene);
}
unsafe extern "C" {
    pub fn rtcAttachGeometry(
        scene: RTCScene,
        geometry: RTCGeometry,
    ) -> ::std::os::raw::c_uint;
}
unsafe extern "C" {
    pub fn rtcAttachGeometryByID(
        scene: RTCScene,
        geometry: RTCGeometry,
        geomID: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcDetachGeometry(scene: RTCScene, geomID: ::std::os::raw::c_uint);
}
unsafe extern "C" {
    pub fn rtcGetGeometry(
        scene: RTCScene,
        geomID: ::std::os::raw::c_uint,
    ) -> RTCGeometry;
}
unsafe extern "C" {
    pub fn rtcGetGeometryThreadSafe(
        scene: RTCScene,
        geomID: ::std::os::raw::c_uint,
    ) -> RTCGeometry;
}
unsafe extern "C" {
    pub fn rtcCommitScene(scene: RTCScene);
}
unsafe extern "C" {
    pub fn rtcJoinCommitScene(scene: RTCScene);
}
pub type RTCProgressMonitorFunction = ::std::option::Option<
    unsafe extern "C" fn(ptr: *mut ::std::os::raw::c_void, n: f64) -> bool,
>;
unsafe extern "C" {
    pub fn rtcSetSceneProgressMonitorFunction(
        scene: RTCScene,
        progress: RTCProgressMonitorFunction,
        ptr: *mut ::std::os::raw::c_void,
    );
}
unsafe extern "C" {
    pub fn rtcSetSceneBuildQuality(scene: RTCScene, quality: RTCBuildQuality);
}
unsafe extern "C" {
    pub fn rtcSetSceneFlags(scene: RTCScene, flags: RTCSceneFlags);
}
unsafe extern "C" {
    pub fn rtcGetSceneFlags(scene: RTCScene) -> RTCSceneFlags;
}
unsafe extern "C" {
    pub fn rtcGetSceneBounds(scene: RTCScene, bounds_o: *mut RTCBounds);
}
unsafe extern "C" {
    pub fn rtcGetSceneLinearBounds(scene: RTCScene, bounds_o: *mut RTCLinearBounds);
}
unsafe extern "C" {
    pub fn rtcPointQuery(
        scene: RTCScene,
        query: *mut RTCPointQuery,
        context: *mut RTCPointQueryContext,
        queryFunc: RTCPointQueryFunction,
        userPtr: *mut ::std::os::raw::c_void,
    ) -> bool;
}
unsafe extern "C" {
    pub fn rtcPointQuery4(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        query: *mut RTCPointQuery4,
        context: *mut RTCPointQueryContext,
        queryFunc: RTCPointQueryFunction,
        userPtr: *mut *mut ::std::os::raw::c_void,
    ) -> bool;
}
unsafe extern "C" {
    pub fn rtcPointQuery8(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        query: *mut RTCPointQuery8,
        context: *mut RTCPointQueryContext,
        queryFunc: RTCPointQueryFunction,
        userPtr: *mut *mut ::std::os::raw::c_void,
    ) -> bool;
}
unsafe extern "C" {
    pub fn rtcPointQuery16(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        query: *mut RTCPointQuery16,
        context: *mut RTCPointQueryContext,
        queryFunc: RTCPointQueryFunction,
        userPtr: *mut *mut ::std::os::raw::c_void,
    ) -> bool;
}
unsafe extern "C" {
    pub fn rtcIntersect1(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHit,
    );
}
unsafe extern "C" {
    pub fn rtcIntersect4(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHit4,
    );
}
unsafe extern "C" {
    pub fn rtcIntersect8(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHit8,
    );
}
unsafe extern "C" {
    pub fn rtcIntersect16(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHit16,
    );
}
unsafe extern "C" {
    pub fn rtcIntersect1M(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHit,
        M: ::std::os::raw::c_uint,
        byteStride: usize,
    );
}
unsafe extern "C" {
    pub fn rtcIntersect1Mp(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut *mut RTCRayHit,
        M: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcIntersectNM(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *mut RTCRayHitN,
        N: ::std::os::raw::c_uint,
        M: ::std::os::raw::c_uint,
        byteStride: usize,
    );
}
unsafe extern "C" {
    pub fn rtcIntersectNp(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        rayhit: *const RTCRayHitNp,
        N: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded1(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRay,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded4(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRay4,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded8(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRay8,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded16(
        valid: *const ::std::os::raw::c_int,
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRay16,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded1M(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRay,
        M: ::std::os::raw::c_uint,
        byteStride: usize,
    );
}
unsafe extern "C" {
    pub fn rtcOccluded1Mp(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut *mut RTCRay,
        M: ::std::os::raw::c_uint,
    );
}
unsafe extern "C" {
    pub fn rtcOccludedNM(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *mut RTCRayN,
        N: ::std::os::raw::c_uint,
        M: ::std::os::raw::c_uint,
        byteStride: usize,
    );
}
unsafe extern "C" {
    pub fn rtcOccludedNp(
        scene: RTCScene,
        context: *mut RTCIntersectContext,
        ray: *const RTCRayNp,
        N: ::std::os::raw::c_uint,
    );
}
#[repr(C)]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCCollision {
    pub geomID0: ::std::os::raw::c_uint,
    pub primID0: ::std::os::raw::c_uint,
    pub geomID1: ::std::os::raw::c_uint,
    pub primID1: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCCollision"][::std::mem::size_of::<RTCCollision>() - 16usize];
    ["Alignment of RTCCollision"][::std::mem::align_of::<RTCCollision>() - 4usize];
    [
        "Offset of field: RTCCollision::geomID0",
    ][::std::mem::offset_of!(RTCCollision, geomID0) - 0usize];
    [
        "Offset of field: RTCCollision::primID0",
    ][::std::mem::offset_of!(RTCCollision, primID0) - 4usize];
    [
        "Offset of field: RTCCollision::geomID1",
    ][::std::mem::offset_of!(RTCCollision, geomID1) - 8usize];
    [
        "Offset of field: RTCCollision::primID1",
    ][::std::mem::offset_of!(RTCCollision, primID1) - 12usize];
};
pub type RTCCollideFunc = ::std::option::Option<
    unsafe extern "C" fn(
        userPtr: *mut ::std::os::raw::c_void,
        collisions: *mut RTCCollision,
        num_collisions: ::std::os::raw::c_uint,
    ),
>;
unsafe extern "C" {
    pub fn rtcCollide(
        scene0: RTCScene,
        scene1: RTCScene,
        callback: RTCCollideFunc,
        userPtr: *mut ::std::os::raw::c_void,
    );
}
#[repr(C)]
#[derive(Debug)]
pub struct RTCBVHTy {
    _unused: [u8; 0],
}
pub type RTCBVH = *mut RTCBVHTy;
#[repr(C)]
#[repr(align(32))]
#[derive(Debug, Default, Copy, Clone)]
pub struct RTCBuildPrimitive {
    pub lower_x: f32,
    pub lower_y: f32,
    pub lower_z: f32,
    pub geomID: ::std::os::raw::c_uint,
    pub upper_x: f32,
    pub upper_y: f32,
    pub upper_z: f32,
    pub primID: ::std::os::raw::c_uint,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCBuildPrimitive"][::std::mem::size_of::<RTCBuildPrimitive>() - 32usize];
    [
        "Alignment of RTCBuildPrimitive",
    ][::std::mem::align_of::<RTCBuildPrimitive>() - 32usize];
    [
        "Offset of field: RTCBuildPrimitive::lower_x",
    ][::std::mem::offset_of!(RTCBuildPrimitive, lower_x) - 0usize];
    [
        "Offset of field: RTCBuildPrimitive::lower_y",
    ][::std::mem::offset_of!(RTCBuildPrimitive, lower_y) - 4usize];
    [
        "Offset of field: RTCBuildPrimitive::lower_z",
    ][::std::mem::offset_of!(RTCBuildPrimitive, lower_z) - 8usize];
    [
        "Offset of field: RTCBuildPrimitive::geomID",
    ][::std::mem::offset_of!(RTCBuildPrimitive, geomID) - 12usize];
    [
        "Offset of field: RTCBuildPrimitive::upper_x",
    ][::std::mem::offset_of!(RTCBuildPrimitive, upper_x) - 16usize];
    [
        "Offset of field: RTCBuildPrimitive::upper_y",
    ][::std::mem::offset_of!(RTCBuildPrimitive, upper_y) - 20usize];
    [
        "Offset of field: RTCBuildPrimitive::upper_z",
    ][::std::mem::offset_of!(RTCBuildPrimitive, upper_z) - 24usize];
    [
        "Offset of field: RTCBuildPrimitive::primID",
    ][::std::mem::offset_of!(RTCBuildPrimitive, primID) - 28usize];
};
#[repr(C)]
#[derive(Debug)]
pub struct RTCThreadLocalAllocatorTy {
    _unused: [u8; 0],
}
pub type RTCThreadLocalAllocator = *mut RTCThreadLocalAllocatorTy;
pub type RTCCreateNodeFunction = ::std::option::Option<
    unsafe extern "C" fn(
        allocator: RTCThreadLocalAllocator,
        childCount: ::std::os::raw::c_uint,
        userPtr: *mut ::std::os::raw::c_void,
    ) -> *mut ::std::os::raw::c_void,
>;
pub type RTCSetNodeChildrenFunction = ::std::option::Option<
    unsafe extern "C" fn(
        nodePtr: *mut ::std::os::raw::c_void,
        children: *mut *mut ::std::os::raw::c_void,
        childCount: ::std::os::raw::c_uint,
        userPtr: *mut ::std::os::raw::c_void,
    ),
>;
pub type RTCSetNodeBoundsFunction = ::std::option::Option<
    unsafe extern "C" fn(
        nodePtr: *mut ::std::os::raw::c_void,
        bounds: *mut *const RTCBounds,
        childCount: ::std::os::raw::c_uint,
        userPtr: *mut ::std::os::raw::c_void,
    ),
>;
pub type RTCCreateLeafFunction = ::std::option::Option<
    unsafe extern "C" fn(
        allocator: RTCThreadLocalAllocator,
        primitives: *const RTCBuildPrimitive,
        primitiveCount: usize,
        userPtr: *mut ::std::os::raw::c_void,
    ) -> *mut ::std::os::raw::c_void,
>;
pub type RTCSplitPrimitiveFunction = ::std::option::Option<
    unsafe extern "C" fn(
        primitive: *const RTCBuildPrimitive,
        dimension: ::std::os::raw::c_uint,
        position: f32,
        leftBounds: *mut RTCBounds,
        rightBounds: *mut RTCBounds,
        userPtr: *mut ::std::os::raw::c_void,
    ),
>;
impl RTCBuildFlags {
    pub const RTC_BUILD_FLAG_NONE: RTCBuildFlags = RTCBuildFlags(0);
    pub const RTC_BUILD_FLAG_DYNAMIC: RTCBuildFlags = RTCBuildFlags(1);
}
impl ::std::ops::BitOr<RTCBuildFlags> for RTCBuildFlags {
    type Output = Self;
    #[inline]
    fn bitor(self, other: Self) -> Self {
        RTCBuildFlags(self.0 | other.0)
    }
}
impl ::std::ops::BitOrAssign for RTCBuildFlags {
    #[inline]
    fn bitor_assign(&mut self, rhs: RTCBuildFlags) {
        self.0 |= rhs.0;
    }
}
impl ::std::ops::BitAnd<RTCBuildFlags> for RTCBuildFlags {
    type Output = Self;
    #[inline]
    fn bitand(self, other: Self) -> Self {
        RTCBuildFlags(self.0 & other.0)
    }
}
impl ::std::ops::BitAndAssign for RTCBuildFlags {
    #[inline]
    fn bitand_assign(&mut self, rhs: RTCBuildFlags) {
        self.0 &= rhs.0;
    }
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCBuildFlags(pub ::std::os::raw::c_uint);
impl RTCBuildConstants {
    pub const RTC_BUILD_MAX_PRIMITIVES_PER_LEAF: RTCBuildConstants = RTCBuildConstants(
        32,
    );
}
#[repr(transparent)]
#[derive(Debug, Copy, Clone, Hash, PartialEq, Eq)]
pub struct RTCBuildConstants(pub ::std::os::raw::c_uint);
#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct RTCBuildArguments {
    pub byteSize: usize,
    pub buildQuality: RTCBuildQuality,
    pub buildFlags: RTCBuildFlags,
    pub maxBranchingFactor: ::std::os::raw::c_uint,
    pub maxDepth: ::std::os::raw::c_uint,
    pub sahBlockSize: ::std::os::raw::c_uint,
    pub minLeafSize: ::std::os::raw::c_uint,
    pub maxLeafSize: ::std::os::raw::c_uint,
    pub traversalCost: f32,
    pub intersectionCost: f32,
    pub bvh: RTCBVH,
    pub primitives: *mut RTCBuildPrimitive,
    pub primitiveCount: usize,
    pub primitiveArrayCapacity: usize,
    pub createNode: RTCCreateNodeFunction,
    pub setNodeChildren: RTCSetNodeChildrenFunction,
    pub setNodeBounds: RTCSetNodeBoundsFunction,
    pub createLeaf: RTCCreateLeafFunction,
    pub splitPrimitive: RTCSplitPrimitiveFunction,
    pub buildProgress: RTCProgressMonitorFunction,
    pub userPtr: *mut ::std::os::raw::c_void,
}
#[allow(clippy::unnecessary_operation, clippy::identity_op)]
const _: () = {
    ["Size of RTCBuildArguments"][::std::mem::size_of::<RTCBuildArguments>() - 136usize];
    [
        "Alignment of RTCBuildArguments",
    ][::std::mem::align_of::<RTCBuildArguments>() - 8usize];
    [
        "Offset of field: RTCBuildArguments::byteSize",
    ][::std::mem::offset_of!(RTCBuildArguments, byteSize) - 0usize];
    [
        "Offset of field: RTCBuildArguments::buildQuality",
    ][::std::mem::offset_of!(RTCBuildArguments, buildQuality) - 8usize];
    [
        "Offset of field: RTCBuildArguments::buildFlags",
    ][::std::mem::offset_of!(RTCBuildArguments, buildFlags) - 12usize];
    [
        "Offset of field: RTCBuildArguments::maxBranchingFactor",
    ][::std::mem::offset_of!(RTCBuildArguments, maxBranchingFactor) - 16usize];
    [
        "Offset of field: RTCBuildArguments::maxDepth",
    ][::std::mem::offset_of!(RTCBuildArguments, maxDepth) - 20usize];
    [
        "Offset of field: RTCBuildArguments::sahBlockSize",
    ][::std::mem::offset_of!(RTCBuildArguments, sahBlockSize) - 24usize];
    [
        "Offset of field: RTCBuildArguments::minLeafSize",
    ][::std::mem::offset_of!(RTCBuildArguments, minLeafSize) - 28usize];
    [
        "Offset of field: RTCBuildArguments::maxLeafSize",
    ][::std::mem::offset_of!(RTCBuildArguments, maxLeafSize) - 32usize];
    [
        "Offset of field: RTCBuildArguments::traversalCost",
    ][::std::mem::offset_of!(RTCBuildArguments, traversalCost) - 36usize];
    [
        "Offset of field: RTCBuildArguments::intersectionCost",
    ][::std::mem::offset_of!(RTCBuildArguments, intersectionCost) - 40usize];
    [
        "Offset of field: RTCBuildArguments::bvh",
    ][::std::mem::offset_of!(RTCBuildArguments, bvh) - 48usize];
    [
        "Offset of field: RTCBuildArguments::primitives",
    ][::std::mem::offset_of!(RTCBuildArguments, primitives) - 56usize];
    [
        "Offset of field: RTCBuildArguments::primitiveCount",
    ][::std::mem::offset_of!(RTCBuildArguments, primitiveCount) - 64usize];
    [
        "Offset of field: RTCBuildArguments::primitiveArrayCapacity",
    ][::std::mem::offset_of!(RTCBuildArguments, primitiveArrayCapacity) - 72usize];
    [
        "Offset of field: RTCBuildArguments::createNode",
    ][::std::mem::offset_of!(RTCBuildArguments, createNode) - 80usize];
    [
        "Offset of field: RTCBuildArguments::setNodeChildren",
    ][::std::mem::offset_of!(RTCBuildArguments, setNodeChildren) - 88usize];
    [
        "Offset of field: RTCBuildArguments::setNodeBounds",
    ][::std::mem::offset_of!(RTCBuildArguments, setNodeBounds) - 96usize];
    [
        "Offset of field: RTCBuildArguments::createLeaf",
    ][::std::mem::offset_of!(RTCBuildArguments, createLeaf) - 104usize];
    [
        "Offset of field: RTCBuildArguments::splitPrimitive",
    ][::std::mem::offset_of!(RTCBuildArguments, splitPrimitive) - 112usize];
    [
        "Offset of field: RTCBuildArguments::buildProgress",
    ][::std::mem::offset_of!(RTCBuildArguments, buildProgress) - 120usize];
    [
        "Offset of field: RTCBuildArguments::userPtr",
    ][::std::mem::offset_of!(RTCBuildArguments, userPtr) - 128usize];
};
impl Default for RTCBuildArguments {
    fn default() -> Self {
        let mut s = ::std::mem::MaybeUninit::<Self>::uninit();
        unsafe {
            ::std::ptr::write_bytes(s.as_mut_ptr(), 0, 1);
            s.assume_init()
        }
    }
}
unsafe extern "C" {
    pub fn rtcNewBVH(device: RTCDevice) -> RTCBVH;
}
unsafe extern "C" {
    pub fn rtcBuildBVH(args: *const RTCBuildArguments) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcThreadLocalAlloc(
        allocator: RTCThreadLocalAllocator,
        bytes: usize,
        align: usize,
    ) -> *mut ::std::os::raw::c_void;
}
unsafe extern "C" {
    pub fn rtcRetainBVH(bvh: RTCBVH);
}
unsafe extern "C" {
    pub fn rtcReleaseBVH(bvh: RTCBVH);
}
