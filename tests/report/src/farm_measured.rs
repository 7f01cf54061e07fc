// Written by `cargo xtask farm`: what it measured on its three nodes, and how long the job took.
const START_SECS: f64 = 0.459;
const FRAME_SECS: f64 = 0.0300;
const GAP_SECS: f64 = 1.282;
const JOIN_SECS: f64 = 0.026;
const TOTAL_SECS: f64 = 22.04;
