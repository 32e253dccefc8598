//! A small file of one line of JSON and one line with the SHA-256 of the first: a cut or edited file is known as one.
use sha2::{Digest, Sha256};

/// SHA-256 of a text in hexadecimal.
pub(crate) fn hex_digest(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The file's text for a body of one line.
pub(crate) fn seal(body: &str) -> String {
    format!("{body}\nsha256 {}\n", hex_digest(body))
}

/// The body of a file.
///
/// # Errors
/// What is wrong with the file.
pub(crate) fn unseal(bytes: &[u8]) -> Result<&str, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not UTF-8".to_owned())?;
    let mut lines = text.lines();
    let (Some(body), Some(sum), None) = (lines.next(), lines.next(), lines.next()) else {
        return Err("it is cut off: expected two lines".to_owned());
    };
    if sum.strip_prefix("sha256 ") != Some(hex_digest(body).as_str()) {
        return Err("its checksum differs: it was cut off or edited".to_owned());
    }
    Ok(body)
}
