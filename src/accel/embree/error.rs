//! Errors of Embree.

use embree4_sys::RTCError;
use std::fmt;

/// Kind of an error of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ErrorCode {
    None,
    Unknown,
    InvalidArgument,
    InvalidOperation,
    OutOfMemory,
    UnsupportedCpu,
    Cancelled,
    /// An unknown code.
    Other(u32),
}

impl From<RTCError> for ErrorCode {
    fn from(code: RTCError) -> Self {
        match code {
            RTCError::RTC_ERROR_NONE => ErrorCode::None,
            RTCError::RTC_ERROR_UNKNOWN => ErrorCode::Unknown,
            RTCError::RTC_ERROR_INVALID_ARGUMENT => ErrorCode::InvalidArgument,
            RTCError::RTC_ERROR_INVALID_OPERATION => ErrorCode::InvalidOperation,
            RTCError::RTC_ERROR_OUT_OF_MEMORY => ErrorCode::OutOfMemory,
            RTCError::RTC_ERROR_UNSUPPORTED_CPU => ErrorCode::UnsupportedCpu,
            RTCError::RTC_ERROR_CANCELLED => ErrorCode::Cancelled,
            RTCError(other) => ErrorCode::Other(other),
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ErrorCode::None => f.write_str("no error"),
            ErrorCode::Unknown => f.write_str("unknown error"),
            ErrorCode::InvalidArgument => f.write_str("invalid argument"),
            ErrorCode::InvalidOperation => f.write_str("invalid operation"),
            ErrorCode::OutOfMemory => f.write_str("out of memory"),
            ErrorCode::UnsupportedCpu => f.write_str("processor not supported"),
            ErrorCode::Cancelled => f.write_str("cancelled"),
            ErrorCode::Other(code) => write!(f, "error {code}"),
        }
    }
}

/// Reason why the ray tracer cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EmbreeError {
    /// A call failed.
    #[error("Embree cannot {action}: {code}{}{message}", if .message.is_empty() { "" } else { ": " })]
    Call {
        /// The failed action.
        action: &'static str,
        /// The kind of error.
        code: ErrorCode,
        /// Embree's message.
        message: String,
    },
    /// This build of Embree lacks a required feature.
    #[error("this build of Embree has no {0}")]
    Unsupported(&'static str),
    /// Unsupported packet width.
    #[error("packets of {0} rays are not supported: 1, 4, 8 or 16")]
    PacketWidth(u32),
    /// A shape has more primitives than a 32-bit index allows.
    #[error("a shape has more than 4294967295 primitives")]
    TooManyPrimitives,
}
