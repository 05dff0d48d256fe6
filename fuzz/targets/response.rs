//! Responses of cameras.

use gnomon::light::response::Response;

pub fn run(bytes: &[u8]) {
    let text = super::text(bytes);
    if let Ok(response) = Response::from_csv(text) {
        assert!(Response::from_csv(&response.csv()).is_ok());
    }
}
