//! Mission files (TOML): read and checked, edited, templates, schemas.
//!
//! [`crate::mission`] defines the content of a mission; this module also knows the keys of effects. Reading checks a file against
//! the single list of keys, fills in the defaults, and then checks the keys in combination; every error states file, line, key and
//! value. An existing [`Mission`](crate::mission::Mission) is valid, and serialises to its file, as resolved.

mod edit;
mod galaxies;
mod imported;
pub mod lookup;
mod number;
mod read;
mod schema;
mod template;

pub use edit::{add_effect, edit, with_effects};
pub use galaxies::of_table as galaxies_of_table;
pub(crate) use number::Handle;
#[cfg(feature = "cli")]
pub(crate) use read::read_text;
pub(crate) use read::{check_value, line_at};
pub use schema::schema;
pub use template::template;
