//! Settings of the iterative solvers and of the spring simulation.

use choreo_motion::Time;
use choreo_motion::ik::Solver;

/// Settings of the solvers. Scenes use the defaults, whose errors are in `tests/report`; `choreo measure` compares others with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// The method for chains of three bones or more. Two bones have a closed form.
    pub chain_solver: Solver,
    /// Largest number of iterations for a chain of three bones or more.
    pub chain_iterations: usize,
    /// Distance from its target, in metres, at which a chain counts as solved.
    pub chain_tolerance: f64,
    /// Simulation steps of springs per second, a divisor of [`Time::TICKS_PER_SECOND`].
    pub spring_rate: i64,
}

impl Default for SolverSettings {
    fn default() -> SolverSettings {
        SolverSettings {
            chain_solver: Solver::LeastSquares,
            chain_iterations: 24,
            chain_tolerance: 1e-5,
            spring_rate: 60,
        }
    }
}

impl SolverSettings {
    pub(crate) fn spring_step(&self) -> Time {
        Time(Time::TICKS_PER_SECOND / self.spring_rate)
    }
}
