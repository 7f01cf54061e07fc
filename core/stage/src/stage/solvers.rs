//! Numbers of the iterative solvers and of the spring simulation.

use choreo_motion::Time;
use choreo_motion::ik::Solver;

/// Scenes run with the defaults, whose errors are in `tests/report`; `choreo measure` compares others with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// The method for chains of three bones or more. Two bones have a closed form.
    pub chain_solver: Solver,
    /// Most iterations for a chain of three bones or more.
    pub chain_iterations: usize,
    /// Metres from its target within which a chain is solved.
    pub chain_tolerance: f64,
    /// Steps of springs a second, a divisor of [`Time::TICKS_PER_SECOND`].
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
