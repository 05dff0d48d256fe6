//! What is read of glTF's extensions, and what is said of the others.

use gltf::json::Root;

/// Extensions that are read.
const READ: [&str; 11] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    // What they say changes nothing here.
    "KHR_xmp_json_ld",
    "KHR_xmp",
];

/// Beginnings of extensions without which a thing looks different and has the same shape.
const OF_LOOKS: [&str; 6] = [
    "KHR_lights",
    "KHR_materials_",
    "EXT_lights",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_texture_procedurals",
];

/// Refuses what a file's shapes cannot be read without, and notes what is passed over.
pub(super) fn check(root: &Root, notes: &mut Vec<String>) -> Result<(), String> {
    for name in &root.extensions_required {
        let is_of_looks = OF_LOOKS.iter().any(|start| name.starts_with(start));
        if !READ.contains(&name.as_str()) && !is_of_looks {
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
        "KHR_draco_mesh_compression" => {
            ": save the model without it (gltf-transform copy IN.glb OUT.glb; Blender opens it too)"
        }
        "KHR_texture_basisu" => {
            ": save the model with PNG, JPEG or WebP pictures (gltf-transform ktxdecompress IN.glb OUT.glb)"
        }
        "EXT_mesh_gpu_instancing" => ": save each instance as a node of its own",
        _ => "",
    }
}
