//! Figures of a diagnosis.
