//! The arguments of directives: numbers, names and parameter lists.

use super::directive::{ActiveTimes, AttributeTarget, DirectiveKind, KEYWORDS, Name};
use super::lexer::{LexError, Lexer, Token, TokenKind, shorten};
use super::params::{Param, ParamSet, ParamType, Values};
use crate::diagnostic::{Diagnostics, did_you_mean};
use crate::names::nfc;
use crate::source::Span;

/// An error that is already in the diagnostics.
pub struct Reported;

/// Reads arguments and reports their errors.
pub struct Arguments<'a> {
    /// Receives the errors.
    pub diagnostics: &'a mut Diagnostics,
}

impl Arguments<'_> {
    /// Reports an error of the lexer.
    pub fn report(&mut self, error: LexError) -> Reported {
        self.diagnostics.error(error.span, error.message);
        Reported
    }

    /// Reports an error.
    pub fn fail<T>(&mut self, span: Span, message: impl Into<String>) -> Result<T, Reported> {
        self.diagnostics.error(span, message);
        Err(Reported)
    }

    /// Warns of a pbrt-v3 form, once.
    pub fn v3(&mut self, span: Span, message: &str) {
        self.diagnostics.warning_first(span, message);
    }

    /// `N` numbers, in brackets or not.
    pub fn numbers<const N: usize>(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<[f64; N], Reported> {
        let bracketed = self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Open);
        let start = lexer.position();
        if bracketed {
            lexer.next_token().map_err(|e| self.report(e))?;
        }
        let mut values = Vec::with_capacity(N);
        if bracketed {
            lexer.numbers_f64(&mut values).map_err(|e| self.report(e))?;
            self.close_bracket(lexer)?;
        } else {
            for _ in 0..N {
                values.push(lexer.number_f64().map_err(|e| self.report(e))?);
            }
        }
        let (count, span) = (values.len(), lexer.span(start, lexer.position()));
        match values.try_into() {
            Ok(array) => Ok(array),
            Err(_) => self.fail(span, format!("{keyword} takes {N} numbers, not {count}")),
        }
    }

    /// An affine matrix, column by column. pbrt divides points by w, so a last row 0 0 0 w is normalised to 0 0 0 1.
    /// Other last rows are projections and therefore errors.
    pub fn matrix(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<[f64; 16], Reported> {
        let start = self.peek(lexer)?.map_or(lexer.position(), |t| t.span.start as usize);
        let m: [f64; 16] = self.numbers(lexer, keyword)?;
        let last_row = [m[3], m[7], m[11], m[15]];
        let [x, y, z, w] = last_row;
        if [x, y, z] != [0.0; 3] || w == 0.0 {
            let row = last_row.map(|v| v.to_string()).join(" ");
            let span = lexer.span(start, lexer.position());
            let message =
                format!("the last row of this matrix is {row}: an affine one has 0 0 0 w, with w other than 0");
            self.diagnostics.error(span, message).help("the last row is every fourth number");
            return Err(Reported);
        }
        Ok(m.map(|v| v / w))
    }

    /// `StartTime`, `EndTime` or `All`.
    pub fn active_times(&mut self, lexer: &mut Lexer<'_>) -> Result<ActiveTimes, Reported> {
        let token = self.next(lexer, "StartTime, EndTime or All")?;
        match lexer.slice(token.span) {
            b"StartTime" => Ok(ActiveTimes::Start),
            b"EndTime" => Ok(ActiveTimes::End),
            b"All" => Ok(ActiveTimes::All),
            _ => self.fail(token.span, "StartTime, EndTime or All is expected"),
        }
    }

    /// The target of `Attribute`.
    pub fn attribute_target(&mut self, name: &Name) -> Result<AttributeTarget, Reported> {
        match name.text.as_str() {
            "shape" => Ok(AttributeTarget::Shape),
            "light" => Ok(AttributeTarget::Light),
            "material" => Ok(AttributeTarget::Material),
            "medium" => Ok(AttributeTarget::Medium),
            "texture" => Ok(AttributeTarget::Texture),
            other => self
                .fail(name.span, format!("Attribute knows shape, light, material, medium and texture, not `{other}`")),
        }
    }

    /// The one or two names of `MediumInterface`.
    pub fn medium_interface(&mut self, lexer: &mut Lexer<'_>) -> Result<DirectiveKind, Reported> {
        let inside = self.name(lexer, "MediumInterface")?;
        let has_second = self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Quoted);
        let outside = if has_second { self.name(lexer, "MediumInterface")? } else { inside.clone() };
        Ok(DirectiveKind::MediumInterface { inside, outside })
    }

    /// A name: a string argument in normal form C, so that names compare equal in any form.
    pub fn name(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<Name, Reported> {
        let Name { text, span } = self.verbatim_name(lexer, keyword)?;
        Ok(Name { text: nfc(&text).into_owned(), span })
    }

    /// A string argument as written, such as a file name.
    pub fn verbatim_name(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<Name, Reported> {
        let position = lexer.position();
        let token = self.next(lexer, "a string")?;
        if token.kind != TokenKind::Quoted {
            let found = shorten(&lexer.text(token.span));
            lexer.rewind(position);
            return self.fail(token.span, format!("{keyword} takes a string in quotes here, not `{found}`"));
        }
        let text = lexer.unquote(token.span).map_err(|e| self.report(e))?;
        Ok(Name { text, span: token.span })
    }

    /// The value of an option, with or without quotes.
    pub fn option_value(&mut self, lexer: &mut Lexer<'_>) -> Result<Name, Reported> {
        let position = lexer.position();
        let token = self.next(lexer, "the value of an option")?;
        let text = match token.kind {
            TokenKind::Quoted => lexer.unquote(token.span).map_err(|e| self.report(e))?,
            TokenKind::Word if !is_keyword(lexer, token) => lexer.text(token.span).into_owned(),
            TokenKind::Word | TokenKind::Open | TokenKind::Close => {
                let found = shorten(&lexer.text(token.span));
                lexer.rewind(position);
                let message = format!("an option takes a number, true, false or a string in quotes, not `{found}`");
                return self.fail(token.span, message);
            }
        };
        Ok(Name { text, span: token.span })
    }

    fn next(&mut self, lexer: &mut Lexer<'_>, expected: &str) -> Result<Token, Reported> {
        match lexer.next_token() {
            Ok(Some(token)) => Ok(token),
            Ok(None) => {
                let end = lexer.span(lexer.position(), lexer.position());
                self.fail(end, format!("{expected} is expected, not the end of the file"))
            }
            Err(error) => Err(self.report(error)),
        }
    }

    fn peek(&mut self, lexer: &mut Lexer<'_>) -> Result<Option<Token>, Reported> {
        lexer.peek().map_err(|e| self.report(e))
    }

    /// The parameter list. An error in one parameter skips to the next.
    pub fn params(&mut self, lexer: &mut Lexer<'_>, owner: String, span: Span) -> ParamSet {
        let mut set = ParamSet::new(owner, span);
        loop {
            match lexer.peek() {
                Ok(Some(token)) if token.kind == TokenKind::Quoted => {
                    // Exists, since it was peeked.
                    let _ = lexer.next_token();
                    match self.param(lexer, token) {
                        Ok(Some(param)) => set.push(param, self.diagnostics),
                        Ok(None) => {}
                        Err(Reported) => skip_to_param(lexer),
                    }
                }
                Ok(_) => return set,
                Err(error) => {
                    self.report(error);
                    let _ = lexer.next_token();
                    skip_to_param(lexer);
                }
            }
        }
    }

    /// One parameter; `None` if it was read but is invalid.
    fn param(&mut self, lexer: &mut Lexer<'_>, declaration: Token) -> Result<Option<Param>, Reported> {
        let span = declaration.span;
        let text = lexer.unquote(span).map_err(|e| self.report(e))?;
        let mut words = text.split_ascii_whitespace();
        let (type_name, name) = match (words.next(), words.next(), words.next()) {
            (Some(type_name), Some(name), None) => (type_name, name),
            _ => {
                let message = format!("a parameter is declared as \"type name\", not \"{}\"", shorten(&text));
                return self.fail(span, message);
            }
        };
        let Some(ty) = ParamType::from_name(type_name) else {
            let diagnostic = self.diagnostics.error(span, format!("unknown parameter type `{}`", shorten(type_name)));
            match did_you_mean(type_name, ParamType::NAMES.iter().copied()) {
                Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
                None => diagnostic.help(format!("types are {}", ParamType::NAMES.join(", "))),
            };
            return Err(Reported);
        };
        if ParamType::is_v3_name(type_name) {
            let advice = if ty == ParamType::Xyz { "rgb" } else { ty.name() };
            self.v3(span, &format!("type `{type_name}` is pbrt-v3; pbrt-v4 writes `{advice}`"));
        }
        let bracketed = self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Open);
        let start = self.peek(lexer)?.map_or(lexer.position(), |t| t.span.start as usize);
        if bracketed {
            self.next(lexer, "[")?;
        }
        let values = self.values(lexer, ty, name, bracketed)?;
        if bracketed {
            self.close_bracket(lexer)?;
        }
        let value_span = lexer.span(start, lexer.position());
        if values.len() % ty.arity() != 0 {
            let message = format!("`{type_name}` takes {} numbers each, and `{name}` has {}", ty.arity(), values.len());
            self.diagnostics.error(value_span, message);
            return Ok(None);
        }
        Ok(Some(Param::new(ty, name.to_owned(), span, value_span, values)))
    }

    fn values(
        &mut self,
        lexer: &mut Lexer<'_>,
        ty: ParamType,
        name: &str,
        bracketed: bool,
    ) -> Result<Values, Reported> {
        let by_name = ty == ParamType::Spectrum && self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Quoted);
        match ty {
            ParamType::String => self.strings(lexer, name, bracketed).map(Values::Strings),
            ParamType::Texture => {
                let names = self.strings(lexer, name, bracketed)?;
                Ok(Values::Strings(names.iter().map(|name| nfc(name).into_owned()).collect()))
            }
            ParamType::Spectrum if by_name => self.strings(lexer, name, bracketed).map(Values::Strings),
            ParamType::Bool => self.bools(lexer, bracketed).map(Values::Bools),
            ParamType::Integer => {
                let mut values = Vec::new();
                let read = if bracketed {
                    lexer.numbers_i32(&mut values)
                } else {
                    lexer.number_i32().map(|value| values.push(value))
                };
                read.map_err(|e| self.report(e)).map(|()| Values::Integers(values))
            }
            ParamType::Point3 => {
                let mut values = Vec::new();
                let read = if bracketed {
                    lexer.numbers_f64(&mut values)
                } else {
                    lexer.number_f64().map(|value| values.push(value))
                };
                read.map_err(|e| self.report(e)).map(|()| Values::Doubles(values))
            }
            _ => {
                let mut values = Vec::new();
                let read = if bracketed {
                    lexer.numbers_f32(&mut values)
                } else {
                    lexer.number_f32().map(|value| values.push(value))
                };
                read.map_err(|e| self.report(e)).map(|()| Values::Floats(values))
            }
        }
    }

    fn strings(&mut self, lexer: &mut Lexer<'_>, name: &str, bracketed: bool) -> Result<Vec<String>, Reported> {
        let mut values = Vec::new();
        while values.is_empty() || bracketed {
            match self.peek(lexer)? {
                Some(token) if token.kind == TokenKind::Quoted => {
                    self.next(lexer, "a string")?;
                    values.push(lexer.unquote(token.span).map_err(|e| self.report(e))?);
                }
                Some(token) if token.kind == TokenKind::Close && bracketed => break,
                Some(token) => {
                    let found = shorten(&lexer.text(token.span));
                    return self.fail(token.span, format!("`{name}` takes strings in quotes, not `{found}`"));
                }
                None => {
                    let end = lexer.span(lexer.position(), lexer.position());
                    return self.fail(end, "a string is expected, not the end of the file");
                }
            }
        }
        Ok(values)
    }

    fn bools(&mut self, lexer: &mut Lexer<'_>, bracketed: bool) -> Result<Vec<bool>, Reported> {
        let mut values = Vec::new();
        while values.is_empty() || bracketed {
            let position = lexer.position();
            let token = self.next(lexer, "true or false")?;
            match lexer.slice(token.span) {
                b"true" | b"\"true\"" => values.push(true),
                b"false" | b"\"false\"" => values.push(false),
                b"]" if bracketed => {
                    lexer.rewind(position);
                    break;
                }
                _ => {
                    let found = shorten(&lexer.text(token.span));
                    lexer.rewind(position);
                    return self.fail(token.span, format!("true or false is expected, not `{found}`"));
                }
            }
        }
        Ok(values)
    }

    fn close_bracket(&mut self, lexer: &mut Lexer<'_>) -> Result<(), Reported> {
        let position = lexer.position();
        let token = self.next(lexer, "`]`")?;
        if token.kind == TokenKind::Close {
            return Ok(());
        }
        let found = shorten(&lexer.text(token.span));
        lexer.rewind(position);
        self.fail(token.span, format!("`]` or a number is expected, not `{found}`"))
    }
}

/// Skips to the next keyword, or to the next string that declares a parameter.
fn skip_to_param(lexer: &mut Lexer<'_>) {
    skip_until(lexer, |lexer, token| {
        let declares = || {
            let text = lexer.text(token.span);
            let first = text.trim_matches('"').split_ascii_whitespace().next();
            first.is_some_and(|word| ParamType::from_name(word).is_some()) && text.trim_matches('"').contains(' ')
        };
        is_keyword(lexer, token) || token.kind == TokenKind::Quoted && declares()
    });
}

/// Drops tokens up to one that `stop` accepts.
pub fn skip_until(lexer: &mut Lexer<'_>, stop: impl Fn(&Lexer<'_>, Token) -> bool) {
    loop {
        let position = lexer.position();
        match lexer.next_token() {
            Ok(None) => return,
            Ok(Some(token)) if stop(lexer, token) => return lexer.rewind(position),
            // Invalid strings in the skipped part belong to the reported error.
            Ok(Some(_)) | Err(_) => {}
        }
    }
}

/// True for the keyword of a directive.
pub fn is_keyword(lexer: &Lexer<'_>, token: Token) -> bool {
    token.kind == TokenKind::Word && KEYWORDS.iter().any(|k| k.as_bytes() == lexer.slice(token.span))
}
