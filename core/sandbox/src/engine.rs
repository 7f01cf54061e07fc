//! The Rhai engine without the packages that untrusted scripts must not use.

use rhai::Engine;
use rhai::packages::{
    BasicArrayPackage, BasicMapPackage, BitFieldPackage, CorePackage, LogicPackage, MoreStringPackage,
    Package,
};

/// An engine with Rhai's standard packages except mathematics (choreo registers its own), time (scripts must not read the clock)
/// and blobs.
pub fn engine() -> Engine {
    let mut engine = Engine::new_raw();
    for package in [
        CorePackage::new().as_shared_module(),
        LogicPackage::new().as_shared_module(),
        BitFieldPackage::new().as_shared_module(),
        BasicArrayPackage::new().as_shared_module(),
        BasicMapPackage::new().as_shared_module(),
        MoreStringPackage::new().as_shared_module(),
    ] {
        engine.register_global_module(package);
    }
    // Deeper expressions could use up a thread's stack.
    engine.set_max_expr_depths(64, 48);
    engine
}
