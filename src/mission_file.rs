//! Mission files (TOML): read and checked, edited, templates, schemas.
//!
//! [`crate::mission`] holds what a mission says; this module knows the effects' keys beside the mission's own. Reading checks a
//! file against the one list of keys, fills in the defaults, and then looks at what keys say together; every refusal names
//! file, line, key and value. A [`Mission`](crate::mission::Mission) that exists is valid, and serialises to the file it came
//! from, as resolved.

mod edit;
mod galaxies;
mod imported;
pub mod lookup;
mod number;
mod read;
mod schema;
mod template;

pub use edit::{add_effect, edit, with_effects};
pub(crate) use galaxies::of_table as galaxies_of_table;
pub(crate) use number::Handle;
pub(crate) use read::{check_value, line_at, read_text};
pub use schema::schema;
pub use template::template;
