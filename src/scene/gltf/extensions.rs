//! What is read of glTF's extensions, and what is said of the others.

use gltf::json::Root;

/// Extensions that are read.
const READ: [&str; 8] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
    // What they say changes nothing here.
    "KHR_xmp_json_ld",
    "KHR_xmp",
];

/// Refuses what a file cannot be read without, and notes what is passed over.
pub(super) fn check(root: &Root, notes: &mut Vec<String>) -> Result<(), String> {
    for name in &root.extensions_required {
        if !READ.contains(&name.as_str()) {
            return Err(format!(
                "extensionsRequired: \"{name}\" is not read{}",
                advice(name)
            ));
        }
    }
    let mut passed_over: Vec<&str> = root
        .extensions_used
        .iter()
        .map(String::as_str)
        .filter(|name| !READ.contains(name))
        .collect();
    passed_over.dedup();
    if !passed_over.is_empty() {
        notes.push(format!(
            "glTF extensions are passed over: {}",
            passed_over.join(", ")
        ));
    }
    Ok(())
}

/// What somebody can do whose file needs it.
fn advice(name: &str) -> &'static str {
    match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            ": save the model without compression (gltfpack -noq, or gltf-transform copy)"
        }
        "KHR_texture_basisu" => ": save the model with PNG, JPEG or WebP pictures",
        _ => "",
    }
}
