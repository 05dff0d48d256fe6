//! The shapes that entries are written in.

/// An enum of choices with the word of each in a file, and what each means.
macro_rules! choices {
    (
        $(#[doc = $doc:literal])+
        pub enum $Name:ident, $what:literal {
            $( $(#[doc = $says:literal])+ $Variant:ident = $word:literal, )+
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $Name {
            $( $(#[doc = $says])+ $Variant, )+
        }

        impl $Name {
            /// All of them, by the names that files use.
            pub const BY_NAME: [(&'static str, Self); [$($word),+].len()] = [$(($word, Self::$Variant)),+];

            /// Its name.
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$Variant => $word, )+
                }
            }
        }

        impl $crate::scene::schema::choice::Choice for $Name {
            const WHAT: &'static str = $what;
            const WORDS: &'static [(&'static str, Self)] = &Self::BY_NAME;
            const SAYS: &'static [&'static str] = &[$(concat!($($says),+)),+];
        }
    };
}

/// Keys of a table, each an entry: what it is, its name and type, the values that it takes, and what holds without it; for
/// those that have to be there, what is expected.
///
/// ```text
/// keys! {
///     /// Lone markers.
///     pub static MARKER: MarkerKeys;
///     required {
///         /// Side of its black square.
///         size_m: f64, Numbers::between(1e-4, 100.0).unit("m") => "a length in metres is expected";
///     }
///     /// Turn in the plane.
///     rotation_deg: f64, ANGLE => Is(0.0);
/// }
/// ```
macro_rules! keys {
    (
        $(#[doc = $doc:literal])+
        pub static $KEYS:ident: $Keys:ident;
        $( required {
            $( $(#[doc = $first_says:literal])+ $first:ident: $first_type:ty $(, $first_takes:expr)? => $expected:literal; )+
        } )?
        $( $(#[doc = $says:literal])+ $name:ident: $type:ty $(, $takes:expr)? => $missing:expr; )*
    ) => {
        $(#[doc = $doc])+
        pub struct $Keys {
            $($(
                $(#[doc = $first_says])+
                pub $first: $crate::scene::schema::key::Key<$first_type, $crate::scene::schema::key::Required>,
            )+)?
            $( $(#[doc = $says])+ pub $name: $crate::scene::schema::key::Key<$type>, )*
        }

        $(#[doc = $doc])+
        pub static $KEYS: $Keys = $Keys {
            $($( $first: $crate::scene::schema::key::Key {
                name: stringify!($first),
                says: concat!($($first_says),+),
                takes: keys!(@takes $($first_takes)?),
                missing: $crate::scene::schema::key::Required($expected),
            }, )+)?
            $( $name: $crate::scene::schema::key::Key {
                name: stringify!($name),
                says: concat!($($says),+),
                takes: keys!(@takes $($takes)?),
                missing: $missing,
            }, )*
        };

        impl $Keys {
            /// All of them.
            pub const ALL: &[&dyn $crate::scene::schema::section::AnyKey] = &[$($(&$KEYS.$first,)+)? $(&$KEYS.$name,)*];
        }
    };
    (@takes) => { () };
    (@takes $takes:expr) => { $takes };
}

/// Settings: a struct with a field for each of a table's keys, written as for `keys!`, and fields that are no keys.
macro_rules! settings {
    (
        $(#[doc = $doc:literal])+
        #[derive($($derived:ident),+)]
        pub struct $Settings:ident, $KEYS:ident: $Keys:ident;
        $( $(#[doc = $says:literal])+ $name:ident: $type:ty $(, $takes:expr)? => $missing:expr; )+
        $( besides { $( $(#[doc = $also_says:literal])+ $also:ident: $also_type:ty => $also_default:expr; )+ } )?
    ) => {
        keys! {
            $(#[doc = $doc])+
            pub static $KEYS: $Keys;
            $( $(#[doc = $says])+ $name: $type $(, $takes)? => $missing; )+
        }

        $(#[doc = $doc])+
        #[derive($($derived),+)]
        pub struct $Settings {
            $( $(#[doc = $says])+ pub $name: $type, )+
            $($( $(#[doc = $also_says])+ pub $also: $also_type, )+)?
        }

        impl Default for $Settings {
            fn default() -> Self {
                Self {
                    $( $name: $KEYS.$name.default().clone(), )+
                    $($( $also: $also_default, )+)?
                }
            }
        }

        impl $crate::scene::schema::settings::Settings for $Settings {
            fn read(
                table: &$crate::scene::reader::Table,
                default: &Self,
            ) -> Result<Self, $crate::scene::error::SceneError> {
                Ok(Self {
                    $( $name: $KEYS.$name.read_or(table, &default.$name)?, )+
                    $($( $also: default.$also.clone(), )+)?
                })
            }

            fn at_quality(mut self, quality: $crate::scene::quality::Quality) -> Self {
                $( if let Some(value) = $KEYS.$name.of_quality(quality) {
                    self.$name = value.clone();
                } )+
                self
            }

            fn with_changes(mut self, from: &Self, to: &Self) -> Self {
                $( if from.$name != to.$name {
                    self.$name = to.$name.clone();
                } )+
                $($( if from.$also != to.$also {
                    self.$also = to.$also.clone();
                } )+)?
                self
            }

            fn changed_keys(
                from: &Self,
                to: &Self,
                given: Option<&Self>,
            ) -> Vec<$crate::scene::schema::settings::KeyChange> {
                let changes = [
                    $( $KEYS.$name.change(&from.$name, &to.$name, given.map(|given| &given.$name)), )+
                ];
                changes.into_iter().flatten().collect()
            }
        }
    };
}
