//! Texts of errors without a procedural macro (decision 57).

/// Implements `Display` and `Error` for a type: each line is a pattern of the type and its text.
#[doc(hidden)]
#[macro_export]
macro_rules! error_texts {
    ($name:ident: $($pattern:pat => $format:literal $(, $argument:expr)*;)*) => {
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self {
                    $($pattern => write!(f, $format $(, $argument)*),)*
                }
            }
        }

        impl std::error::Error for $name {}
    };
}
