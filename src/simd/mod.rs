//! Lane kernels: the same arithmetic for many numbers at once, over slices.
//!
//! A kernel is written once over the vectors of the processor's native width and compiled for each instruction set; a call
//! takes the best one that the machine has. Only IEEE addition, multiplication, division and square root are used, in
//! one order and never fused, so the results are the same bits at any width. What is no full vector at
//! the end of the slices is padded.
//!
//! Reading order: [`curve`].

pub mod curve;
