// effect: halo
// about: a line around actors that widens
// version: 1
// hook: shell
// param width = 2 px in 0..30: of the line
// param color = rgb(0.9, 0.8, 0.3): of the line
fn effect(p: Parameters) -> Shell {
    return Shell(p.width, p.color, 0.0);
}
