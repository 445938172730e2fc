//! From text to checked directives.
//!
//! The parser follows `Include` and `Import`, checks that blocks nest, and goes on after an error at the next
//! directive, so that one run finds the errors of a whole scene. It hands each directive to a [`Visitor`] as soon as
//! it is read.

use super::directive::{ActiveTimes, AttributeTarget, Directive, DirectiveKind, KEYWORDS, Name};
use super::lexer::{LexError, Lexer, Token, TokenKind, shorten};
use super::params::{Param, ParamSet, ParamType, Values};
use crate::import::diagnostic::{Diagnostics, did_you_mean};
use crate::import::source::{FileId, SourceMap, Span};
use std::path::{Path, PathBuf};

/// Files that may include each other in a chain.
const MAX_INCLUDE_DEPTH: usize = 64;
/// Blocks that may nest.
const MAX_BLOCK_DEPTH: usize = 10_000;

/// Receives the directives of a scene in their order.
pub trait Visitor {
    /// Takes one directive.
    fn directive(&mut self, directive: Directive, sources: &SourceMap, diagnostics: &mut Diagnostics);
}

impl<F: FnMut(Directive, &SourceMap, &mut Diagnostics)> Visitor for F {
    fn directive(&mut self, directive: Directive, sources: &SourceMap, diagnostics: &mut Diagnostics) {
        self(directive, sources, diagnostics);
    }
}

/// Parses a scene file and all that it includes.
pub fn parse_file(path: &Path, sources: &mut SourceMap, diagnostics: &mut Diagnostics, visitor: &mut dyn Visitor) {
    match sources.read(path) {
        Ok(file) => parse_source(file, path, sources, diagnostics, visitor),
        Err(error) => diagnostics.missing_file(path, error, None),
    }
}

/// Parses a text that is in `sources` already; files that it names are sought in the folder of `path`.
pub fn parse_source(
    file: FileId,
    path: &Path,
    sources: &mut SourceMap,
    diagnostics: &mut Diagnostics,
    visitor: &mut dyn Visitor,
) {
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let open = vec![identity(path)];
    let mut parser =
        Parser { sources, diagnostics, visitor, folder, open, blocks: Vec::new(), world: None, early: false };
    parser.file(file);
    parser.finish(file);
}

/// What tells two files apart.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

/// An error that is in the diagnostics already.
struct Reported;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Block {
    Attribute,
    Transform,
    Object,
}

impl Block {
    fn begin(self) -> &'static str {
        match self {
            Block::Attribute => "AttributeBegin",
            Block::Transform => "TransformBegin",
            Block::Object => "ObjectBegin",
        }
    }

    fn end(self) -> &'static str {
        match self {
            Block::Attribute => "AttributeEnd",
            Block::Transform => "TransformEnd",
            Block::Object => "ObjectEnd",
        }
    }
}

struct Parser<'a> {
    sources: &'a mut SourceMap,
    diagnostics: &'a mut Diagnostics,
    visitor: &'a mut dyn Visitor,
    folder: PathBuf,
    /// Files being parsed, outermost first.
    open: Vec<PathBuf>,
    blocks: Vec<(Block, Span)>,
    world: Option<Span>,
    /// True once a world directive before `WorldBegin` was reported.
    early: bool,
}

impl Parser<'_> {
    fn file(&mut self, file: FileId) {
        let bytes = self.sources.shared_bytes(file);
        let mut lexer = Lexer::new(&bytes, file);
        loop {
            match lexer.next_token() {
                Ok(None) => break,
                Ok(Some(token)) => {
                    if self.directive(&mut lexer, token).is_err() {
                        skip_to_directive(&mut lexer);
                    }
                }
                Err(error) => {
                    self.report(error);
                    skip_to_directive(&mut lexer);
                }
            }
        }
    }

    fn finish(&mut self, file: FileId) {
        for (block, span) in std::mem::take(&mut self.blocks) {
            self.diagnostics.error(span, format!("{} has no {}", block.begin(), block.end())).remark("opened here");
        }
        if self.world.is_none() && !self.diagnostics.has_errors() {
            let end = self.sources.bytes(file).len() as u32;
            let help =
                "a scene has WorldBegin after its camera, film and other options, and before its shapes and lights";
            self.diagnostics.error(Span { file, start: end, end }, "scene has no WorldBegin").help(help);
        }
    }

    fn report(&mut self, error: LexError) -> Reported {
        self.diagnostics.error(error.span, error.message);
        Reported
    }

    fn fail<T>(&mut self, span: Span, message: impl Into<String>) -> Result<T, Reported> {
        self.diagnostics.error(span, message);
        Err(Reported)
    }

    fn emit(&mut self, kind: DirectiveKind, span: Span, params: ParamSet) {
        self.visitor.directive(Directive { kind, span, params }, self.sources, self.diagnostics);
    }

    fn directive(&mut self, lexer: &mut Lexer<'_>, token: Token) -> Result<(), Reported> {
        use DirectiveKind as D;
        let span = token.span;
        let text = lexer.text(span).into_owned();
        if token.kind != TokenKind::Word {
            return self.fail(span, format!("a directive is expected, not `{}`", shorten(&text)));
        }
        let keyword = text.as_str();
        self.check_section(keyword, span);
        let kind = match keyword {
            "Identity" => D::Identity,
            "Translate" => D::Translate(self.numbers(lexer, keyword)?),
            "Scale" => D::Scale(self.numbers(lexer, keyword)?),
            "Rotate" => D::Rotate(self.numbers(lexer, keyword)?),
            "LookAt" => D::LookAt(self.numbers(lexer, keyword)?),
            "Transform" => D::Transform(self.numbers(lexer, keyword)?),
            "ConcatTransform" => D::ConcatTransform(self.numbers(lexer, keyword)?),
            "TransformTimes" => D::TransformTimes(self.numbers(lexer, keyword)?),
            "ActiveTransform" => D::ActiveTransform(self.active_times(lexer)?),
            "CoordinateSystem" => D::CoordinateSystem(self.name(lexer, keyword)?),
            "CoordSysTransform" => D::CoordSysTransform(self.name(lexer, keyword)?),
            "ReverseOrientation" => D::ReverseOrientation,
            "WorldBegin" => return self.world_begin(span),
            "WorldEnd" => {
                self.v3(span, "WorldEnd is not used by pbrt-v4");
                D::WorldEnd
            }
            "AttributeBegin" => return self.open_block(Block::Attribute, D::AttributeBegin, span),
            "TransformBegin" => {
                self.v3(span, "TransformBegin is pbrt-v3; AttributeBegin takes its place");
                return self.open_block(Block::Transform, D::TransformBegin, span);
            }
            "ObjectBegin" => {
                let name = self.name(lexer, keyword)?;
                return self.open_block(Block::Object, D::ObjectBegin(name), span);
            }
            "AttributeEnd" => return self.close_block(Block::Attribute, D::AttributeEnd, span),
            "TransformEnd" => return self.close_block(Block::Transform, D::TransformEnd, span),
            "ObjectEnd" => return self.close_block(Block::Object, D::ObjectEnd, span),
            "ObjectInstance" => D::ObjectInstance(self.name(lexer, keyword)?),
            "ColorSpace" => D::ColorSpace(self.name(lexer, keyword)?),
            "NamedMaterial" => D::NamedMaterial(self.name(lexer, keyword)?),
            "MediumInterface" => self.medium_interface(lexer)?,
            "Include" | "Import" => return self.include(lexer, keyword, span),
            _ => return self.with_params(lexer, keyword, span),
        };
        self.emit(kind, span, ParamSet::new(keyword, span));
        Ok(())
    }

    /// Directives that end in a parameter list.
    fn with_params(&mut self, lexer: &mut Lexer<'_>, keyword: &str, span: Span) -> Result<(), Reported> {
        use DirectiveKind as D;
        let make: fn(Name) -> D = match keyword {
            "Accelerator" => D::Accelerator,
            "AreaLightSource" => D::AreaLightSource,
            "Camera" => D::Camera,
            "Film" => D::Film,
            "Integrator" => D::Integrator,
            "LightSource" => D::LightSource,
            "MakeNamedMaterial" => D::MakeNamedMaterial,
            "MakeNamedMedium" => D::MakeNamedMedium,
            "Material" => D::Material,
            "PixelFilter" => D::PixelFilter,
            "Sampler" => D::Sampler,
            "Shape" => D::Shape,
            "Texture" => {
                let (name, value, class) =
                    (self.name(lexer, keyword)?, self.name(lexer, keyword)?, self.name(lexer, keyword)?);
                let params = self.params(lexer, format!("Texture \"{}\"", class.text), span);
                self.emit(D::Texture { name, value, class }, span, params);
                return Ok(());
            }
            "Attribute" => {
                let name = self.name(lexer, keyword)?;
                let params = self.params(lexer, format!("Attribute \"{}\"", name.text), span);
                let target = self.attribute_target(&name)?;
                self.emit(D::Attribute(target), span, params);
                return Ok(());
            }
            "Option" => {
                let params = self.params(lexer, "Option".to_owned(), span);
                self.emit(D::Option, span, params);
                return Ok(());
            }
            _ => return self.unknown_directive(keyword, span),
        };
        let name = self.name(lexer, keyword)?;
        let params = self.params(lexer, format!("{keyword} \"{}\"", name.text), span);
        self.emit(make(name), span, params);
        Ok(())
    }

    fn unknown_directive(&mut self, keyword: &str, span: Span) -> Result<(), Reported> {
        let diagnostic = self.diagnostics.error(span, format!("unknown directive `{}`", shorten(keyword)));
        if let Some(near) = did_you_mean(keyword, KEYWORDS.iter().copied()) {
            diagnostic.help(format!("did you mean `{near}`?"));
        }
        Err(Reported)
    }

    fn v3(&mut self, span: Span, message: &str) {
        self.diagnostics.warning_first(span, message);
    }

    /// Options belong before `WorldBegin`, shapes and lights after it.
    fn check_section(&mut self, keyword: &str, span: Span) {
        let is_option = matches!(
            keyword,
            "Camera" | "Film" | "Sampler" | "Integrator" | "PixelFilter" | "Accelerator" | "Option" | "TransformTimes"
        );
        let is_world = matches!(
            keyword,
            "Shape"
                | "LightSource"
                | "AreaLightSource"
                | "ObjectBegin"
                | "ObjectEnd"
                | "ObjectInstance"
                | "Material"
                | "MakeNamedMaterial"
                | "NamedMaterial"
                | "Texture"
                | "ReverseOrientation"
        );
        match self.world {
            Some(world) if is_option => {
                let message = format!("{keyword} belongs before WorldBegin");
                self.diagnostics.error(span, message).label(world, "WorldBegin is here");
            }
            None if is_world && !self.early => {
                self.early = true;
                self.diagnostics.error(span, format!("{keyword} belongs after WorldBegin"));
            }
            _ => {}
        }
    }

    fn world_begin(&mut self, span: Span) -> Result<(), Reported> {
        if let Some(first) = self.world {
            self.diagnostics.error(span, "second WorldBegin").label(first, "first one");
            return Err(Reported);
        }
        self.world = Some(span);
        self.emit(DirectiveKind::WorldBegin, span, ParamSet::new("WorldBegin", span));
        Ok(())
    }

    fn open_block(&mut self, block: Block, kind: DirectiveKind, span: Span) -> Result<(), Reported> {
        if self.blocks.len() >= MAX_BLOCK_DEPTH {
            return self.fail(span, format!("more than {MAX_BLOCK_DEPTH} blocks in each other"));
        }
        if let Some(&(_, outer)) = self.blocks.iter().find(|(b, _)| block == Block::Object && *b == Block::Object) {
            self.diagnostics.error(span, "ObjectBegin inside an object").label(outer, "the object begins here");
        }
        self.blocks.push((block, span));
        self.emit(kind, span, ParamSet::new(block.begin(), span));
        Ok(())
    }

    fn close_block(&mut self, block: Block, kind: DirectiveKind, span: Span) -> Result<(), Reported> {
        match self.blocks.last().copied() {
            Some((open, _)) if open == block => {
                self.blocks.pop();
                self.emit(kind, span, ParamSet::new(block.end(), span));
                Ok(())
            }
            Some((open, opened)) => {
                let message = format!("{} inside {}", block.end(), open.begin());
                self.diagnostics.error(span, message).label(opened, format!("no {} since here", open.end()));
                Err(Reported)
            }
            None => self.fail(span, format!("{} without {}", block.end(), block.begin())),
        }
    }

    fn include(&mut self, lexer: &mut Lexer<'_>, keyword: &str, span: Span) -> Result<(), Reported> {
        let name = self.name(lexer, keyword)?;
        let path = self.folder.join(&name.text);
        let identity = identity(&path);
        if self.open.contains(&identity) {
            return self.fail(name.span, format!("`{}` includes itself", name.text));
        }
        if self.open.len() >= MAX_INCLUDE_DEPTH {
            return self.fail(name.span, format!("more than {MAX_INCLUDE_DEPTH} files include each other"));
        }
        let file = match self.sources.read(&path) {
            Ok(file) => file,
            Err(error) => {
                self.diagnostics.missing_file(path, error, Some(name.span));
                return Ok(());
            }
        };
        self.open.push(identity);
        let depth = self.blocks.len();
        // What an imported file sets stays inside it, as if it stood in a block of its own.
        let scoped = keyword == "Import";
        let opened =
            if scoped { self.open_block(Block::Attribute, DirectiveKind::AttributeBegin, span) } else { Ok(()) };
        if opened.is_ok() {
            self.file(file);
        }
        if scoped {
            self.close_import(depth, span);
        }
        self.open.pop();
        opened
    }

    /// Closes the block of an import and those that the imported file left open.
    fn close_import(&mut self, depth: usize, span: Span) {
        while self.blocks.len() > depth + 1 {
            if let Some((block, opened)) = self.blocks.pop() {
                let message = format!("{} has no {} in its file", block.begin(), block.end());
                self.diagnostics.error(opened, message).remark("opened here");
            }
        }
        if self.blocks.len() == depth + 1 {
            self.blocks.pop();
            self.emit(DirectiveKind::AttributeEnd, span, ParamSet::new("AttributeEnd", span));
        }
    }

    fn numbers<const N: usize>(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<[f32; N], Reported> {
        let bracketed = self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Open);
        let start = lexer.position();
        if bracketed {
            lexer.next_token().map_err(|e| self.report(e))?;
        }
        let mut values = Vec::with_capacity(N);
        if bracketed {
            lexer.numbers_f32(&mut values).map_err(|e| self.report(e))?;
            self.close_bracket(lexer)?;
        } else {
            for _ in 0..N {
                values.push(lexer.number_f32().map_err(|e| self.report(e))?);
            }
        }
        let (count, span) = (values.len(), lexer.span(start, lexer.position()));
        match values.try_into() {
            Ok(array) => Ok(array),
            Err(_) => self.fail(span, format!("{keyword} takes {N} numbers, not {count}")),
        }
    }

    fn active_times(&mut self, lexer: &mut Lexer<'_>) -> Result<ActiveTimes, Reported> {
        let token = self.next(lexer, "StartTime, EndTime or All")?;
        match lexer.slice(token.span) {
            b"StartTime" => Ok(ActiveTimes::Start),
            b"EndTime" => Ok(ActiveTimes::End),
            b"All" => Ok(ActiveTimes::All),
            _ => self.fail(token.span, "StartTime, EndTime or All is expected"),
        }
    }

    fn attribute_target(&mut self, name: &Name) -> Result<AttributeTarget, Reported> {
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

    fn medium_interface(&mut self, lexer: &mut Lexer<'_>) -> Result<DirectiveKind, Reported> {
        let inside = self.name(lexer, "MediumInterface")?;
        let has_second = self.peek(lexer)?.is_some_and(|t| t.kind == TokenKind::Quoted);
        let outside = if has_second { self.name(lexer, "MediumInterface")? } else { inside.clone() };
        Ok(DirectiveKind::MediumInterface { inside, outside })
    }

    /// A string argument.
    fn name(&mut self, lexer: &mut Lexer<'_>, keyword: &str) -> Result<Name, Reported> {
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
    fn params(&mut self, lexer: &mut Lexer<'_>, owner: String, span: Span) -> ParamSet {
        let mut set = ParamSet::new(owner, span);
        loop {
            match lexer.peek() {
                Ok(Some(token)) if token.kind == TokenKind::Quoted => {
                    // It was peeked at, so it is there.
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

    /// One parameter; `None` if it was read but cannot be used.
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
        let Some((ty, is_v3)) = ParamType::from_name(type_name) else {
            let diagnostic = self.diagnostics.error(span, format!("unknown parameter type `{}`", shorten(type_name)));
            match did_you_mean(type_name, ParamType::NAMES.iter().copied()) {
                Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
                None => diagnostic.help(format!("types are {}", ParamType::NAMES.join(", "))),
            };
            return Err(Reported);
        };
        if is_v3 {
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
            ParamType::String | ParamType::Texture => self.strings(lexer, name, bracketed).map(Values::Strings),
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

/// Goes on to the next keyword.
fn skip_to_directive(lexer: &mut Lexer<'_>) {
    skip_until(lexer, is_keyword);
}

/// Goes on to the next keyword, or to the next string that declares a parameter.
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

fn is_keyword(lexer: &Lexer<'_>, token: Token) -> bool {
    token.kind == TokenKind::Word && KEYWORDS.iter().any(|k| k.as_bytes() == lexer.slice(token.span))
}

fn skip_until(lexer: &mut Lexer<'_>, stop: impl Fn(&Lexer<'_>, Token) -> bool) {
    loop {
        let position = lexer.position();
        match lexer.next_token() {
            Ok(None) => return,
            Ok(Some(token)) if stop(lexer, token) => return lexer.rewind(position),
            // Broken strings among what is skipped are part of the error that was reported.
            Ok(Some(_)) | Err(_) => {}
        }
    }
}
