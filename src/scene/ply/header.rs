//! The head of a PLY file: which elements follow, how many, and how their properties are written.

use super::PlyError;

/// How the elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Words.
    Text,
    /// Bytes, least first.
    LittleEndian,
    /// Bytes, most first.
    BigEndian,
}

/// A number's type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number that means white in a colour.
    pub fn white(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 | Self::U16 => 65535.0,
            Self::I32 | Self::U32 => f64::from(u32::MAX),
            Self::F32 | Self::F64 => 1.0,
        }
    }
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    pub name: String,
    pub kind: Kind,
}

/// One number or a list of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

/// Things of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
    /// The line of the head that says so, from 1.
    pub line: usize,
}

impl Element {
    /// The fewest bytes that one of them takes.
    pub fn least_bytes(&self, format: Format) -> usize {
        let bytes = self.properties.iter().map(|property| match property.kind {
            // A digit and a space.
            _ if format == Format::Text => 2,
            Kind::One(scalar) => scalar.bytes(),
            Kind::List { count, .. } => count.bytes(),
        });
        bytes.sum()
    }

    /// The index of the first property with one of some names.
    pub fn index(&self, names: &[&str]) -> Option<usize> {
        self.properties
            .iter()
            .position(|property| names.contains(&property.name.to_ascii_lowercase().as_str()))
    }
}

/// The head.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
    /// The pictures that MeshLab names in comments, each with its line.
    pub textures: Vec<(String, usize)>,
    /// What is no line of a head, each with what is said of it.
    pub passed_over: Vec<String>,
    /// The byte that the first element begins at.
    pub body: usize,
}

/// Longest head that is read, bytes.
const MOST: usize = 1 << 20;

/// Reads the head.
pub fn read(bytes: &[u8]) -> Result<Header, PlyError> {
    let mut lines = Lines { bytes, at: 0 };
    let (mut format, mut elements) = (None, Vec::<Element>::new());
    let (mut textures, mut passed_over) = (Vec::new(), Vec::new());
    let mut number = 0;
    while let Some(line) = lines.next() {
        number += 1;
        let error = |message: String| PlyError {
            line: Some(number),
            message,
        };
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["ply"] | [] | ["obj_info", ..] => {}
            ["comment", "TextureFile", name @ ..] => textures.push((name.join(" "), number)),
            ["comment", ..] => {}
            ["format", name, ..] => {
                format = Some(match *name {
                    "ascii" => Format::Text,
                    "binary_little_endian" => Format::LittleEndian,
                    "binary_big_endian" => Format::BigEndian,
                    other => {
                        return Err(error(format!(
                            "format {other} is unknown; allowed: ascii, binary_little_endian, binary_big_endian"
                        )));
                    }
                });
            }
            ["element", name, count] => {
                let count = count.parse();
                elements.push(Element {
                    name: (*name).to_owned(),
                    count: count.map_err(|_| error(format!("element {name}: no whole number")))?,
                    properties: Vec::new(),
                    line: number,
                });
            }
            ["property", written @ ..] => {
                let property = property(written).map_err(error)?;
                let element = elements.last_mut();
                let element = element
                    .ok_or_else(|| error("a property before the first element".to_owned()))?;
                element.properties.push(property);
            }
            ["end_header", ..] => {
                let format = format.ok_or_else(|| error("no format".to_owned()))?;
                return Ok(Header {
                    format,
                    elements,
                    textures,
                    passed_over,
                    body: lines.at,
                });
            }
            ["format" | "element", ..] => {
                return Err(error(format!("\"{text}\" is no line of a PLY file's head")));
            }
            _ => passed_over.push(format!(
                "line {number}: no line of a PLY file's head: not used"
            )),
        }
        if lines.at > MOST {
            break;
        }
    }
    Err(PlyError {
        line: Some(number),
        message: "the head has no end_header".to_owned(),
    })
}

fn property(words: &[&str]) -> Result<Property, String> {
    let scalar = |name: &str| {
        Scalar::of_name(name).ok_or_else(|| {
            format!("type {name} is unknown; allowed: char, uchar, short, ushort, int, uint, float, double")
        })
    };
    match words {
        ["list", count, item, name] => Ok(Property {
            name: (*name).to_owned(),
            kind: Kind::List {
                count: scalar(count)?,
                item: scalar(item)?,
            },
        }),
        [one, name] => Ok(Property {
            name: (*name).to_owned(),
            kind: Kind::One(scalar(one)?),
        }),
        _ => Err(
            "property: a type and a name are expected, or list, two types and a name".to_owned(),
        ),
    }
}

/// Lines that end as the first one does, so that no byte of the body is taken for a part of a line's end.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let has_returns_alone = {
            let first = self
                .bytes
                .iter()
                .position(|byte| matches!(byte, b'\r' | b'\n'))?;
            self.bytes[first] == b'\r' && self.bytes.get(first + 1) != Some(&b'\n')
        };
        let end = if has_returns_alone { b'\r' } else { b'\n' };
        let rest = &self.bytes[self.at..];
        let length = rest.iter().take(MOST).position(|byte| *byte == end)?;
        self.at += length + 1;
        Some(&rest[..length])
    }
}
