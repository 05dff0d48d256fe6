//! Pages as PDF, in their true size.

use pdf_writer::{Content, Finish as _, Name, Pdf, Rect as Box, Ref, Str, TextStr};

use super::page::{Page, Rect};
use crate::app::files::made_by::SOFTWARE;

const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// The whole file.
pub fn bytes(pages: &[Page]) -> Vec<u8> {
    let mut pdf = Pdf::new();
    let [about, catalog, tree, font] = [1, 2, 3, 4].map(Ref::new);
    let page_ref = |index: usize| Ref::new(5 + 2 * index as i32);
    let content_ref = |index: usize| Ref::new(6 + 2 * index as i32);
    pdf.document_info(about).creator(TextStr(SOFTWARE));
    pdf.catalog(catalog).pages(tree);
    pdf.pages(tree)
        .kids((0..pages.len()).map(page_ref))
        .count(pages.len() as i32);
    // One of the fonts that every reader has.
    pdf.type1_font(font).base_font(Name(b"Helvetica"));
    for (index, page) in pages.iter().enumerate() {
        let [width, height] = page.size_mm.map(points);
        let mut object = pdf.page(page_ref(index));
        object.parent(tree);
        object.media_box(Box::new(0.0, 0.0, width, height));
        object.contents(content_ref(index));
        object.resources().fonts().pair(Name(b"F"), font);
        object.finish();
        pdf.stream(content_ref(index), &content(page));
    }
    pdf.finish()
}

fn content(page: &Page) -> Vec<u8> {
    let mut content = Content::new();
    let top = page.size_mm[1];
    content.set_fill_gray(0.0);
    for black in &page.blacks {
        for Rect { at, size } in std::iter::once(&black.outline).chain(&black.holes) {
            // PDF's y runs up.
            let bottom = top - at[1] - size[1];
            content.rect(
                points(at[0]),
                points(bottom),
                points(size[0]),
                points(size[1]),
            );
        }
        content.fill_even_odd();
    }
    for text in &page.texts {
        content.begin_text();
        content.set_font(Name(b"F"), points(text.size_mm));
        content.next_line(points(text.at[0]), points(top - text.at[1]));
        content.show(Str(text.text.as_bytes()));
        content.end_text();
    }
    content.finish().into_vec()
}

fn points(mm: f64) -> f32 {
    (mm * POINTS_PER_MM) as f32
}
