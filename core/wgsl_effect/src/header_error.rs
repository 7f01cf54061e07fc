//! Mistakes in the header comment of an effect.

use thiserror::Error;

/// A mistake, and its line.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {mistake}")]
pub(crate) struct HeaderError {
    /// Counted from 1.
    pub line: usize,
    pub mistake: HeaderMistake,
}

/// A mistake in a line of the header comment.
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum HeaderMistake {
    #[error("write // {0}")]
    ExpectedSyntax(&'static str),
    #[error("unknown word \"{word}\"; did you mean \"{meant}\"?")]
    Misspelled { word: String, meant: String },
    #[error("the header comment must name the effect: // effect: NAME")]
    NoName,
    #[error("\"{0}\" must be a name of lower-case letters, digits and _, at most 40")]
    Name(String),
    #[error("{0} is declared twice")]
    Twice(String),
    #[error("an effect has at most {most} {what}")]
    TooMany { most: usize, what: &'static str },
    #[error("{name}: \"{value}\" is none of {choices}")]
    NoChoice { name: String, value: String, choices: String },
    #[error("{name}: \"{value}\" is no number")]
    NoNumber { name: String, value: String },
    #[error("{name}: {value} is not within {min}..{max}")]
    OutOfRange { name: String, value: f64, min: f64, max: f64 },
    #[error("{0}: the three numbers of a color are from 0 to 100")]
    Color(String),
    #[error("{name}: {why}")]
    NoColor { name: String, why: String },
    #[error("{name}: a whole number and its range lie within ±{most}")]
    NoWhole { name: String, most: f64 },
    #[error("{name}: vec{count} has {count} numbers, not {given}")]
    Components { name: String, count: usize, given: usize },
    #[error(
        "{name}: a curve is 1 to {most} keys x y, as in curve(0 0, 0.5 0.8, 1 1), with growing x from 0 to 1"
    )]
    Curve { name: String, most: usize },
    #[error(
        "the parameters of an effect are at most {most} numbers: a color is 3 of them, a vector 2 to 4, a curve 16"
    )]
    TooManyNumbers { most: usize },
    #[error("{name} is only for effects with hook: {hook}")]
    OtherHook { name: String, hook: &'static str },
    #[error(
        "an effect that moves vertices must give its largest distance: // reach: METRES, or the name of a parameter"
    )]
    NoReach,
    #[error(
        "an overlay must give its number of lines or triangles: // count: NUMBER, or the name of a parameter"
    )]
    NoCount,
    #[error("{name} is {allowed}")]
    Allowed { name: String, allowed: String },
    /// `near`: a suggestion.
    #[error("{name} is {allowed}, not \"{value}\"{near}")]
    Value { name: String, allowed: String, value: String, near: String },
    #[error("the program has a function {function}; give the pass {name} another name")]
    PassName { name: String, function: String },
    #[error("{0} is only for effects without lines // pass NAME, which give it for each pass")]
    WithPasses(String),
    #[error("count: the parameter {name} must be a number within 0..{most}")]
    CountRange { name: String, most: usize },
    #[error("write // off: PARAMETER = NUMBER; no parameter \"{name}\" is a number{near}")]
    NoOff { name: String, near: String },
}

impl HeaderMistake {
    /// The mistake at a line; `line` is counted from 0.
    pub(crate) fn at(self, line: usize) -> HeaderError {
        HeaderError { line: line + 1, mistake: self }
    }
}
