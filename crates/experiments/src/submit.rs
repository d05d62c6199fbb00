//! Experiments on many machines: what Slurm, Kubernetes and GNU parallel need to play the units of a folder that all machines
//! see. Every task plays a range of units with `cars experiment unit`. Tasks do not depend on each other, and one that is
//! repeated plays what is missing; afterwards `cars experiment merge` writes the results. All of this is text.

mod kubernetes;
mod parallel;
mod slurm;
mod tasks;

pub use kubernetes::Kubernetes;
pub use parallel::Parallel;
pub use slurm::Slurm;
pub use tasks::Tasks;
