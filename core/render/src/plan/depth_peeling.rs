//! Order-independent transparency by depth peeling.

/// Transparent surfaces are blended layer by layer (C. Everitt, "Interactive Order-Independent Transparency", 2001), from the
/// back: the farthest surfaces at each sample are found, then blended; then the next ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthPeeling {
    /// Number of layers. Nearer surfaces are blended over them in sorted order.
    pub layers: u32,
    pub cause: PeelCause,
}

/// Why sorting is not enough. Numbers are indices into `Stage::actors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeelCause {
    /// The stage requests depth peeling.
    Requested,
    /// An actor requests depth peeling for itself.
    RequestedBy(u32),
    /// Copies of two actors, or of one, intersect or are in the wrong order.
    Order(u32, u32),
    /// An actor is not flat, and both its faces are visible.
    SelfOverlap(u32),
}
