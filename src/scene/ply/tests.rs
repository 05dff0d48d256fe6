use glam::Vec4;

use super::*;

const HEAD: &str = "ply\nformat FORMAT 1.0\ncomment made by hand\nobj_info 1\nelement vertex 5\nproperty uchar red\n\
    property float x\nproperty double y\nproperty short z\nproperty uint8 green\nproperty uchar blue\n\
    element extra 1\nproperty list uchar int junk\nelement face 3\nproperty uchar flag\n\
    property list uchar uint vertex_indices\nend_header\n";

const VERTICES: [([u8; 3], [f64; 3]); 5] = [
    ([255, 0, 0], [0., 0., 0.]),
    ([0, 255, 0], [1., 0., 0.]),
    ([0, 0, 255], [1., 1.5, 0.]),
    ([188, 188, 188], [0., 1., 0.]),
    ([0, 0, 0], [0., 0., 2.]),
];
const FACES: [&[u32]; 3] = [&[0, 1, 2, 3], &[0, 4], &[0, 1, 4]];

fn text() -> String {
    let mut text = HEAD.replace("FORMAT", "ascii");
    for ([r, g, b], [x, y, z]) in VERTICES {
        text += &format!("{r} {x} {y:e} {z} {g} {b}\n");
    }
    text += "2 7 8\n";
    for face in FACES {
        let corners: Vec<String> = face.iter().map(u32::to_string).collect();
        text += &format!("9 {} {}\n", face.len(), corners.join(" "));
    }
    text
}

fn bytes(is_big: bool) -> Vec<u8> {
    let name = if is_big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let mut bytes = HEAD.replace("FORMAT", name).into_bytes();
    let mut put = |written: &[u8]| {
        let written = written.iter().copied();
        match is_big {
            true => bytes.extend(written.rev()),
            false => bytes.extend(written),
        }
    };
    for ([r, g, b], [x, y, z]) in VERTICES {
        put(&[r]);
        put(&(x as f32).to_le_bytes());
        put(&y.to_le_bytes());
        put(&(z as i16).to_le_bytes());
        put(&[g]);
        put(&[b]);
    }
    put(&[1]);
    put(&7_i32.to_le_bytes());
    for face in FACES {
        put(&[9]);
        put(&[face.len() as u8]);
        face.iter().for_each(|corner| put(&corner.to_le_bytes()));
    }
    bytes
}

fn read_it(bytes: &[u8]) -> Result<RawModel, String> {
    let read = read(Path::new("a.ply"), bytes);
    read.map(|(model, _)| model)
        .map_err(|error| error.to_string())
}

#[test]
fn all_formats_give_the_same() {
    for bytes in [
        text().into_bytes(),
        text().replace('\n', "\r\n").into_bytes(),
        text().replace('\n', "\r").into_bytes(),
        bytes(false),
        bytes(true),
    ] {
        let model = read_it(&bytes).unwrap();
        let expected: Vec<Vec3> = VERTICES
            .iter()
            .map(|(_, place)| Vec3::from_array(place.map(|part| part as f32)))
            .collect();
        assert_eq!(model.positions, expected);
        assert_eq!(model.triangles.len(), 3);
        let last = model.looks.corners[2].map(|look| model.looks.looks[look as usize].color);
        assert_eq!(
            last,
            [
                Vec4::new(1., 0., 0., 1.),
                Vec4::new(0., 1., 0., 1.),
                Vec4::W
            ]
        );
        let grey = model.looks.looks.iter().map(|look| look.color.x);
        assert!(
            grey.clone().any(|part| (part - 0.5029).abs() < 1e-4),
            "as sRGB has it"
        );
        assert_eq!(
            model.notes.told(),
            [
                "a.ply: element extra: not used",
                "a.ply: faces of fewer than three corners: 1 left out"
            ]
        );
    }
}

#[test]
fn a_head_that_lies_is_a_mistake_with_its_line() {
    let whole = bytes(false);
    let lying = |from: &str, to: &str| {
        let end = whole
            .windows(10)
            .position(|part| part == b"end_header")
            .unwrap();
        let head = String::from_utf8_lossy(&whole[..end]).replace(from, to);
        read_it(&[head.as_bytes(), &whole[end..]].concat()).unwrap_err()
    };
    let message = lying("vertex 5", "vertex 18446744073709551615");
    assert!(message.starts_with("a.ply:5:1: element vertex: the head counts 18446744073709551615, and the file has room for "), "{message}");
    for (from, to, part) in [
        (
            "element face 3",
            "element face 4",
            "the file ends before its last element",
        ),
        (
            "vertex 5",
            "vertex x",
            "a.ply:5:1: element vertex: no whole number",
        ),
        ("float x", "half x", "a.ply:7:1: type half is unknown"),
        (
            "binary_little",
            "binary_middle",
            "a.ply:2:1: format binary_middle_endian is unknown",
        ),
        ("list uchar uint", "list uint uint", "byte "),
        (
            "element extra 1",
            "element extra",
            "a.ply:12:1: \"element extra\" is no line",
        ),
    ] {
        let message = lying(from, to);
        assert!(message.contains(part), "{to}: {message}");
    }
    for length in 0..whole.len() {
        read_it(&whole[..length]).unwrap_err();
    }
    let no_faces = text().replace("element face 3", "element face 0");
    assert!(
        read_it(no_faces.as_bytes())
            .unwrap_err()
            .contains("cloud of points")
    );
    let far = text().replace("3 0 1 4", "3 0 1 5");
    assert!(
        read_it(far.as_bytes())
            .unwrap_err()
            .contains("a face names vertex 5; the file has 5")
    );
    let word = text().replace("9 3 0 1 4", "9 3 0 1 four");
    assert!(
        read_it(word.as_bytes())
            .unwrap_err()
            .contains("a.ply:26:1: four is not a number")
    );
    let nothing = "ply\nformat ascii 1.0\nelement face 99999999999\nend_header\n";
    assert!(
        read_it(nothing.as_bytes())
            .unwrap_err()
            .contains("no faces")
    );
}

#[test]
fn strips_are_wound_alike_and_pictures_named() {
    let text = "ply\nformat ascii 1.0\ncomment TextureFile a b.png\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty float s\nproperty float t\nelement tristrips 1\nproperty list int int vertex_indices\n\
        end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n1 1 0 1 1\n9 0 1 2 3 -1 3 2 0 -1\n";
    let (model, texture) = read(Path::new("a.ply"), text.as_bytes()).unwrap();
    assert_eq!(texture, [("a b.png".to_owned(), 3)]);
    let vertices: Vec<[u32; 3]> = model.triangles.iter().map(|it| it.vertices).collect();
    assert_eq!(vertices, [[0, 1, 2], [1, 3, 2], [3, 2, 0]]);
    let look = model.looks.looks[model.looks.corners[1][1] as usize];
    assert_eq!(look.uv[0], Vec2::new(1.0, 0.0), "v downwards");
}

/// Programs write a line of their own; what it says is not needed.
#[test]
fn a_line_of_the_head_that_is_none_is_told() {
    let expected = read_it(text().as_bytes()).unwrap();
    let odd = text().replace("comment made by hand", "Created by somebody");
    let model = read_it(odd.as_bytes()).unwrap();
    assert_eq!(model.positions, expected.positions);
    let told = model.notes.told();
    assert_eq!(
        told[0],
        "a.ply: line 3: no line of a PLY file's head: not used"
    );
}

/// (1, 1, 1) beside numbers up to 255 is nearly black, and white beside numbers up to 1.
#[test]
fn colors_with_a_point_are_of_bytes_or_not_in_all_of_a_file() {
    let colors = |first: &str| {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property float red\nproperty float green\nproperty float blue\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n\
             0 0 0 {first}\n1 0 0 1 1 1\n0 1 0 nan 0 0\n3 0 1 2\n"
        );
        let model = read_it(text.as_bytes()).unwrap();
        let corners = model.looks.corners[0];
        let colors = corners.map(|look| model.looks.looks[look as usize].color);
        (colors, model.notes.told())
    };
    let ([red, dark, none], told) = colors("255 0 0");
    assert_eq!(red, Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert!(
        dark.max_element() == 1.0 && dark.truncate().max_element() < 1e-3,
        "{dark}"
    );
    assert!(none.is_finite(), "{none}");
    let note = "a.ply: vertex colours above 1 are taken for 0 to 255";
    assert_eq!(told, [note]);
    let ([red, white, _], told) = colors("1 0 0");
    assert_eq!((red, white), (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::ONE));
    assert_eq!(told, [""; 0]);
}

const TWO_PICTURES: &str = "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b b.png\n\
    element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n\
    property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\nend_header\n\
    0 0 0\n1 0 0\n0 1 0\n0 0 1\n\
    3 0 1 2 6 0 0 1 0 1 1 1\n3 0 1 3 6 0 0 1 0 1 1 0\n3 0 2 3 6 0 0 1 0 1 1 -1\n3 1 2 3 6 0 0 nan 0 1 1 1\n";

#[test]
fn each_face_is_of_the_picture_that_it_names() {
    let (model, named) = read(Path::new("a.ply"), TWO_PICTURES.as_bytes()).unwrap();
    assert_eq!(named, [("a.png".to_owned(), 3), ("b b.png".to_owned(), 4)]);
    let materials: Vec<u32> = model.triangles.iter().map(|it| it.material).collect();
    assert_eq!((materials, model.materials.len()), (vec![1, 0, 2, 1], 3));
    // A corner without a place does not tear the picture.
    let places = model.looks.corners[3].map(|look| model.looks.looks[look as usize].uv[0]);
    assert_eq!(places, [Vec2::new(0.0, 1.0); 3]);
    assert_eq!(
        model.notes.told(),
        [
            "a.ply: texnumber: 1 faces are of no picture that is named".to_owned(),
            format!("a.ply: {NO_COORDINATES}"),
        ]
    );
}

#[test]
fn all_pictures_get_other_names() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("b b.png"), "").unwrap();
    let mesh = folder.path().join("a.ply");
    let named = |text: &str| {
        let mut asked = 0;
        let bytes = with_pictures_named(&mesh, text.as_bytes(), |_| {
            asked += 1;
            Ok::<_, std::convert::Infallible>(format!("p{asked}.png"))
        });
        String::from_utf8(bytes.unwrap()).unwrap()
    };
    // One that is not there keeps its name.
    assert_eq!(
        named(TWO_PICTURES),
        TWO_PICTURES.replace("b b.png", "p1.png")
    );
    std::fs::write(folder.path().join("a.png"), "").unwrap();
    let both = TWO_PICTURES.replace("a.png", "p1.png");
    assert_eq!(named(TWO_PICTURES), both.replace("b b.png", "p2.png"));
}
