//! Responses of cameras.
#![no_main]

use gnomon::light::response::Response;

gnomon_fuzz::target!(|text: &str| {
    if let Ok(response) = Response::from_csv(text) {
        assert!(Response::from_csv(&response.csv()).is_ok());
    }
});
