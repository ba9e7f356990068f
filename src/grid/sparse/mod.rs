//! Sparse linear equations whose pattern stays while their values change: ordered and analysed once,
//! refactored in place, solved without allocating. Knows nothing of networks.
//!
//! | file | what it is |
//! |---|---|
//! | [`block`] | what a matrix entry can be: a complex number, or a real 2 x 2 block |
//! | [`ordering`] | the elimination order, by approximate minimum degree |
//! | [`factors`] | the numeric kernel: L and U on a static pattern, no pivoting between rows |
//! | [`active`] | solves for a few rows only, through a packed part of the factors |
//! | [`pivoting`] | faer's LU with partial pivoting, behind the kernel |
//! | [`guarded`] | the kernel, checked by residuals, with the pivoting LU when it fails |

pub mod active;
pub mod block;
pub mod factors;
pub mod guarded;
pub mod ordering;
pub mod pivoting;

pub use block::{Block, Real2};
pub use guarded::Guarded;
pub use ordering::Ordering;
