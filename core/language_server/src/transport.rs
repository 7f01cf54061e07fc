//! JSON-RPC messages with the header `Content-Length`, as used by the Language Server Protocol.

use serde_json::{Value, json};
use std::io::{self, BufRead, Read, Write};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Largest message in bytes.
const MAX_MESSAGE_BYTES: usize = 64 << 20;
/// Longest header line in bytes.
const MAX_HEADER_LINE_BYTES: u64 = 4096;

/// A message of the client, or the end of its messages.
#[derive(Debug, PartialEq)]
pub(crate) enum Received {
    Message(Value),
    /// Invalid data; the next message can still be read.
    Invalid(String),
    /// The client has closed the pipe.
    Closed,
}

/// Reads the next message. A header without a length, and a message that is not JSON, give [`Received::Invalid`].
pub(crate) fn receive(input: &mut impl BufRead) -> Received {
    match try_receive(input) {
        Ok(received) => received,
        Err(error) if error.kind() == io::ErrorKind::InvalidData => Received::Invalid(error.to_string()),
        Err(_) => Received::Closed,
    }
}

fn try_receive(input: &mut impl BufRead) -> io::Result<Received> {
    let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what);
    let mut length: Option<usize> = None;
    let mut lines = 0;
    loop {
        let mut line = Vec::new();
        if input.by_ref().take(MAX_HEADER_LINE_BYTES).read_until(b'\n', &mut line)? == 0 {
            return Ok(Received::Closed);
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end_matches(['\r', '\n']);
        if line.is_empty() && (lines > 0 || length.is_some()) {
            break;
        }
        lines += 1;
        let Some((name, value)) = line.split_once(':') else {
            return Err(invalid("a header line of a message has no colon; write Content-Length: BYTES"));
        };
        if name.eq_ignore_ascii_case("content-length") {
            length = value.trim().parse().ok();
        }
    }
    let length = length.ok_or_else(|| {
        invalid("a message header has no Content-Length, the number of bytes of the message")
    })?;
    if length > MAX_MESSAGE_BYTES {
        io::copy(&mut input.by_ref().take(length as u64), &mut io::sink())?;
        return Err(invalid(&format!(
            "a message has {length} bytes; at most {MAX_MESSAGE_BYTES} bytes are allowed"
        )));
    }
    let mut body = vec![0; length];
    input.read_exact(&mut body)?;
    serde_json::from_slice(&body).map(Received::Message).map_err(|e| invalid(&e.to_string()))
}

/// Connection to the client, shared by threads.
#[derive(Clone)]
pub(crate) struct Client(Arc<Mutex<Box<dyn Write + Send>>>);

impl Client {
    pub(crate) fn new(output: impl Write + Send + 'static) -> Client {
        Client(Arc::new(Mutex::new(Box::new(output))))
    }

    /// Sends a message. Errors are ignored: if the client has disconnected, reading its next message ends the session.
    fn send(&self, message: &Value) {
        let body = message.to_string();
        let mut output = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let written = write!(output, "Content-Length: {}\r\n\r\n{body}", body.len());
        let _ = written.and_then(|()| output.flush());
    }

    pub(crate) fn send_result(&self, id: &Value, result: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "result": result }));
    }

    pub(crate) fn send_error(&self, id: &Value, error: &ResponseError) {
        let error = json!({ "code": error.code, "message": error.message });
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "error": error }));
    }

    /// Sends a request whose response is ignored.
    pub(crate) fn send_request(&self, method: &str, parameters: Value) {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let id = format!("choreo {}", NUMBER.fetch_add(1, Ordering::Relaxed));
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": parameters }));
    }

    pub(crate) fn notify(&self, method: &str, parameters: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": parameters }));
    }
}

/// Error response to a request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ResponseError {
    pub code: i32,
    pub message: String,
}

impl ResponseError {
    pub(crate) const PARSE: i32 = -32700;
    pub(crate) const INVALID: i32 = -32600;
    pub(crate) const UNKNOWN: i32 = -32601;
    pub(crate) const PARAMETERS: i32 = -32602;
    pub(crate) const INTERNAL: i32 = -32603;
    pub(crate) const NOT_INITIALIZED: i32 = -32002;
    pub(crate) const CANCELLED: i32 = -32800;
    /// The request is valid, but failed.
    pub(crate) const FAILED: i32 = -32803;

    pub(crate) fn new(code: i32, message: impl Into<String>) -> ResponseError {
        ResponseError { code, message: message.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receive_all(bytes: &[u8]) -> Vec<Received> {
        let mut input = bytes;
        let mut found = Vec::new();
        loop {
            let received = receive(&mut input);
            let end = received == Received::Closed;
            found.push(received);
            if end {
                return found;
            }
        }
    }

    #[test]
    fn messages_are_read_after_invalid_data() {
        let found = receive_all(
            b"Content-Length: 2\r\n\r\n{}content-length:3\r\nX: y\r\n\r\n{a}Content-Length: 1\r\n\r\n7",
        );
        assert_eq!(found[0], Received::Message(json!({})));
        assert!(matches!(&found[1], Received::Invalid(_)), "{:?}", found[1]);
        assert_eq!(found[2..], [Received::Message(json!(7)), Received::Closed]);
        let found = receive_all(b"hello\nContent-Length: 2\r\n\r\n{}Content-Length: 5\r\n\r\n{}");
        assert!(matches!(&found[0], Received::Invalid(_)));
        assert_eq!(found[1..], [Received::Message(json!({})), Received::Closed]);
        let found = receive_all(b"Content-Length: 99999999999999\r\n\r\n{}");
        assert!(!found.iter().any(|f| matches!(f, Received::Message(_))));
    }

    #[test]
    fn a_message_is_written_with_its_length_in_bytes() {
        #[derive(Clone, Default)]
        struct Sink(Arc<Mutex<Vec<u8>>>);
        impl Write for Sink {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                self.0.lock().unwrap().extend(bytes);
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let sink = Sink::default();
        Client::new(sink.clone()).notify("ä", json!("€"));
        let written = sink.0.lock().unwrap().clone();
        let expected = json!({ "jsonrpc": "2.0", "method": "ä", "params": "€" });
        assert_eq!(receive_all(&written), [Received::Message(expected), Received::Closed]);
    }
}
