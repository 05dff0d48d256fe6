//! The formats of meshes that are read: what each is called, and what its files are called and name.

choices! {
    /// A format of meshes that is read, in the order in which they are told.
    pub enum MeshFormat, "format of meshes" {
        /// Khronos's, binary or not.
        Gltf = "glTF",
        /// Wavefront's, and whatever is nothing else.
        Obj = "OBJ",
        /// Of text or of bytes.
        Ply = "PLY",
        /// Of text or of bytes.
        Stl = "STL",
    }
}

/// Other files that a mesh's file names and that belong to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilesBeside {
    /// It is whole in one file.
    None,
    /// Buffers and pictures, as glTF names them.
    Parts,
    /// Libraries of materials, which name pictures.
    Libraries,
    /// Pictures.
    Pictures,
}

impl MeshFormat {
    /// What the names of its files end in, the first if nothing else is known.
    pub const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Gltf => &["glb", "gltf"],
            Self::Obj => &["obj"],
            Self::Ply => &["ply"],
            Self::Stl => &["stl"],
        }
    }

    /// What its files name.
    pub fn files_beside(self) -> FilesBeside {
        match self {
            Self::Gltf => FilesBeside::Parts,
            Self::Obj => FilesBeside::Libraries,
            Self::Ply => FilesBeside::Pictures,
            Self::Stl => FilesBeside::None,
        }
    }

    /// What the names of all their files end in.
    pub fn all_extensions() -> Vec<&'static str> {
        let all = Self::BY_NAME.iter();
        all.flat_map(|(_, format)| format.extensions())
            .copied()
            .collect()
    }

    /// The names of all, separated by commas.
    pub fn all_names() -> String {
        Self::BY_NAME.map(|(name, _)| name).join(", ")
    }

    /// A file of any of them, in words.
    pub fn any_in_words() -> String {
        let names = Self::BY_NAME.map(|(name, _)| name);
        let [most @ .., last] = &names;
        format!("a {} or {last} file", most.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_formats_are_told() {
        assert_eq!(MeshFormat::all_names(), "glTF, OBJ, PLY, STL");
        assert_eq!(MeshFormat::any_in_words(), "a glTF, OBJ, PLY or STL file");
        assert_eq!(
            MeshFormat::all_extensions(),
            ["glb", "gltf", "obj", "ply", "stl"]
        );
    }
}
