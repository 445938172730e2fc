//! Tokens of a pbrt file.
//!
//! The text consists of bytes; non-ASCII bytes may only occur in strings and comments. Words, quoted strings and
//! brackets are tokens; lists of numbers are parsed without creating tokens.

use crate::number::{NumberError, Parsed, is_delimiter, parse_f32, parse_f64, parse_i32};
use crate::source::{FileId, Span};
use std::borrow::Cow;

/// The kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TokenKind {
    /// A string in quotes; the span includes them.
    Quoted,
    /// `[`
    Open,
    /// `]`
    Close,
    /// Any other word up to the next blank: a directive, a number, `true`, `false`.
    Word,
}

/// A token and its source position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its kind.
    pub kind: TokenKind,
    /// Its source position.
    pub span: Span,
}

/// An error of the lexer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LexError {
    /// One sentence without a full stop.
    pub message: String,
    /// Its source position.
    pub span: Span,
}

/// Reads tokens from a text.
#[derive(Clone, Debug)]
pub struct Lexer<'a> {
    bytes: &'a [u8],
    file: FileId,
    position: usize,
}

impl<'a> Lexer<'a> {
    /// A lexer at the start of `bytes`, whose spans are in `file`. A byte order mark is skipped.
    pub fn new(bytes: &'a [u8], file: FileId) -> Self {
        let position = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Lexer { bytes, file, position }
    }

    /// The current position between tokens.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Returns to a position from [`Lexer::position`].
    pub fn rewind(&mut self, position: usize) {
        self.position = position.min(self.bytes.len());
    }

    /// The span of the bytes `start..end`.
    pub fn span(&self, start: usize, end: usize) -> Span {
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    /// The bytes of a span of this file.
    pub fn slice(&self, span: Span) -> &'a [u8] {
        self.bytes.get(span.start as usize..span.end as usize).unwrap_or(&[])
    }

    /// The text of a span, with invalid UTF-8 replaced.
    pub fn text(&self, span: Span) -> Cow<'a, str> {
        String::from_utf8_lossy(self.slice(span))
    }

    /// The next token, or `None` at the end.
    pub fn next_token(&mut self) -> Result<Option<Token>, LexError> {
        self.skip_blank();
        let start = self.position;
        let Some(&first) = self.bytes.get(start) else { return Ok(None) };
        let kind = match first {
            b'[' | b']' => {
                self.position += 1;
                if first == b'[' { TokenKind::Open } else { TokenKind::Close }
            }
            b'"' => {
                self.skip_quoted()?;
                TokenKind::Quoted
            }
            _ => {
                let length = self.bytes[start..].iter().position(|&b| is_delimiter(b));
                self.position = length.map_or(self.bytes.len(), |n| start + n.max(1));
                TokenKind::Word
            }
        };
        Ok(Some(Token { kind, span: self.span(start, self.position) }))
    }

    /// The next token, without consuming it.
    pub fn peek(&mut self) -> Result<Option<Token>, LexError> {
        let position = self.position;
        let token = self.next_token();
        self.position = position;
        token
    }

    /// The content of a quoted token, with escapes resolved.
    pub fn unquote(&self, span: Span) -> Result<String, LexError> {
        let raw = self.slice(span);
        let inner = &raw[1..raw.len() - 1];
        let mut content = Vec::with_capacity(inner.len());
        let mut i = 0;
        while i < inner.len() {
            if inner[i] == b'\\' {
                let escaped = inner.get(i + 1).copied().unwrap_or(b'\\');
                content.push(match escaped {
                    b'n' => b'\n',
                    b't' => b'\t',
                    b'r' => b'\r',
                    b'b' => 8,
                    b'f' => 12,
                    b'\\' | b'\'' | b'"' => escaped,
                    _ => {
                        let at = span.start as usize + 1 + i;
                        let message = "unknown escape in a string; write \\\\ for a backslash".to_owned();
                        return Err(LexError { message, span: self.span(at, at + 2) });
                    }
                });
                i += 2;
            } else {
                content.push(inner[i]);
                i += 1;
            }
        }
        String::from_utf8(content).map_err(|_| LexError { message: "string is not valid UTF-8".to_owned(), span })
    }

    /// Appends numbers up to `]` or the first other token, which is not consumed.
    pub fn numbers_f32(&mut self, out: &mut Vec<f32>) -> Result<(), LexError> {
        self.numbers(out, parse_f32, "a number")
    }

    /// As [`Lexer::numbers_f32`] in f64 precision.
    pub fn numbers_f64(&mut self, out: &mut Vec<f64>) -> Result<(), LexError> {
        self.numbers(out, parse_f64, "a number")
    }

    /// As [`Lexer::numbers_f32`] for integers.
    pub fn numbers_i32(&mut self, out: &mut Vec<i32>) -> Result<(), LexError> {
        self.numbers(out, parse_i32, "a whole number")
    }

    /// Reads one number.
    pub fn number_f32(&mut self) -> Result<f32, LexError> {
        self.number(parse_f32, "a number")
    }

    /// Reads one number in f64 precision.
    pub fn number_f64(&mut self) -> Result<f64, LexError> {
        self.number(parse_f64, "a number")
    }

    /// Reads one integer.
    pub fn number_i32(&mut self) -> Result<i32, LexError> {
        self.number(parse_i32, "a whole number")
    }

    #[inline]
    fn numbers<T>(
        &mut self,
        out: &mut Vec<T>,
        parse: impl Fn(&[u8]) -> Result<Parsed<T>, NumberError> + Copy,
        what: &str,
    ) -> Result<(), LexError> {
        let bytes = self.bytes;
        let mut i = self.position;
        loop {
            // Skip blanks inline; comments are rare and left to the general routine.
            while i < bytes.len() && matches!(bytes[i], b' ' | b'\n' | b'\r' | b'\t') {
                i += 1;
            }
            match bytes.get(i) {
                None | Some(b']' | b'[' | b'"') => break,
                Some(b'#') => {
                    self.position = i;
                    self.skip_blank();
                    i = self.position;
                }
                Some(_) => match parse(&bytes[i..]) {
                    Ok(Parsed { value, length }) => {
                        out.push(value);
                        i += length;
                    }
                    Err(_) => {
                        self.position = i;
                        return self.number(parse, what).map(|_| ());
                    }
                },
            }
        }
        self.position = i;
        Ok(())
    }

    /// Does not consume other tokens, since they may start the next directive.
    fn number<T>(
        &mut self,
        parse: impl Fn(&[u8]) -> Result<Parsed<T>, NumberError>,
        what: &str,
    ) -> Result<T, LexError> {
        self.skip_blank();
        let start = self.position;
        match self.bytes.get(start..).map(&parse) {
            Some(Ok(Parsed { value, length })) => {
                self.position += length;
                Ok(value)
            }
            other => {
                let found = match self.next_token()? {
                    None => "the end of the file".to_owned(),
                    Some(token) => format!("`{}`", shorten(&self.text(token.span))),
                };
                let message = match other {
                    Some(Err(NumberError::Overflow)) => format!("{found} is too large"),
                    _ => format!("{what} is expected, not {found}"),
                };
                let span = self.span(start, self.position);
                self.position = start;
                Err(LexError { message, span })
            }
        }
    }

    fn skip_blank(&mut self) {
        let bytes = self.bytes;
        let mut i = self.position;
        while let Some(&b) = bytes.get(i) {
            match b {
                b' ' | b'\n' | b'\r' | b'\t' => i += 1,
                b'#' => i += bytes[i..].iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(bytes.len() - i),
                _ => break,
            }
        }
        self.position = i;
    }

    fn skip_quoted(&mut self) -> Result<(), LexError> {
        let start = self.position;
        let mut i = start + 1;
        loop {
            match self.bytes.get(i) {
                Some(b'"') => break,
                Some(b'\\') if self.bytes.get(i + 1).is_some_and(|&b| b != b'\n') => i += 2,
                None | Some(b'\n') => {
                    self.position = i;
                    let message = "string has no end on its line".to_owned();
                    return Err(LexError { message, span: self.span(start, i) });
                }
                Some(_) => i += 1,
            }
        }
        self.position = i + 1;
        Ok(())
    }
}

/// At most 40 characters of a text.
pub fn shorten(text: &str) -> String {
    if text.chars().count() <= 40 { text.to_owned() } else { text.chars().take(37).chain("...".chars()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tokens(text: &[u8]) -> Vec<(TokenKind, String)> {
        let mut lexer = Lexer::new(text, 0);
        let mut all = Vec::new();
        while let Some(token) = lexer.next_token().unwrap() {
            all.push((token.kind, lexer.text(token.span).into_owned()));
        }
        all
    }

    #[test]
    fn tokens_need_no_blanks_between_them() {
        use TokenKind::{Close, Open, Quoted, Word};
        let found = tokens(b"\xef\xbb\xbfShape\"a \\\" b\"[1 2]# end ]\r\nX");
        let expected = [
            (Word, "Shape"),
            (Quoted, "\"a \\\" b\""),
            (Open, "["),
            (Word, "1"),
            (Word, "2"),
            (Close, "]"),
            (Word, "X"),
        ];
        assert_eq!(found, expected.map(|(kind, text)| (kind, text.to_owned())));
    }

    #[test]
    fn strings_resolve_escapes_and_end_on_their_line() {
        let lexer = Lexer::new(b"\"a\\\"\\\\\\n\"", 0);
        assert_eq!(lexer.unquote(lexer.span(0, 9)).unwrap(), "a\"\\\n");
        assert!(Lexer::new(b"\"abc\ndef\"", 0).next_token().is_err());
        let lexer = Lexer::new(b"\"C:\\x\"", 0);
        assert!(lexer.unquote(lexer.span(0, 6)).unwrap_err().message.contains("escape"));
    }

    #[test]
    fn number_lists_stop_where_numbers_stop() {
        let mut lexer = Lexer::new(b" 1 -2.5e1 # three\n 3]", 0);
        let mut values = Vec::new();
        lexer.numbers_f32(&mut values).unwrap();
        assert_eq!(values, [1.0, -25.0, 3.0]);
        assert_eq!(lexer.next_token().unwrap().unwrap().kind, TokenKind::Close);
        let mut lexer = Lexer::new(b"1 2 x 3", 0);
        let error = lexer.numbers_i32(&mut Vec::new()).unwrap_err();
        assert_eq!((error.message.as_str(), error.span.start), ("a whole number is expected, not `x`", 4));
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut lexer = Lexer::new(&bytes, 0);
            for _ in 0..bytes.len() + 1 {
                let before = lexer.position();
                match lexer.next_token() {
                    Ok(None) => break,
                    Ok(Some(token)) if token.kind == TokenKind::Quoted => drop(lexer.unquote(token.span)),
                    Ok(Some(_)) => {}
                    Err(error) => prop_assert!(error.span.end as usize <= bytes.len()),
                }
                prop_assert!(lexer.position() > before);
                let mut copy = lexer.clone();
                let _ = copy.numbers_f32(&mut Vec::new());
                let _ = lexer.clone().numbers_i32(&mut Vec::new());
            }
        }

        #[test]
        fn what_is_written_is_read(strings in proptest::collection::vec("[^\\\\\"\n]{0,12}", 0..8),
                                   numbers in proptest::collection::vec(-1e30_f32..1e30, 0..20)) {
            let mut text = String::new();
            for s in &strings {
                text += &format!("\"{s}\" ");
            }
            text += "[";
            for n in &numbers {
                text += &format!("{n} ");
            }
            text += "]";
            let mut lexer = Lexer::new(text.as_bytes(), 0);
            for s in &strings {
                let token = lexer.next_token().unwrap().unwrap();
                prop_assert_eq!(&lexer.unquote(token.span).unwrap(), s);
            }
            prop_assert_eq!(lexer.next_token().unwrap().unwrap().kind, TokenKind::Open);
            let mut read = Vec::new();
            lexer.numbers_f32(&mut read).unwrap();
            prop_assert_eq!(read, numbers);
        }
    }
}
