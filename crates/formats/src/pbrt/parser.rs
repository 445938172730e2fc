//! Converts text to syntactically valid directives.
//!
//! The parser follows `Include` and `Import`, checks the nesting of blocks, and continues after an error at the next
//! directive, so that one run reports the errors of a whole scene. It passes each directive to a [`Visitor`]
//! immediately.

use super::arguments::{Arguments, Reported, is_keyword, skip_until};
use super::directive::{Directive, DirectiveKind, KEYWORDS, Name};
use super::lexer::{Lexer, Token, TokenKind, shorten};
use super::params::ParamSet;
use crate::diagnostic::{Diagnostics, did_you_mean};
use crate::names::file_in;
use crate::source::{FileId, SourceMap, Span};
use std::path::{Path, PathBuf};

/// Maximum depth of file inclusion.
const MAX_INCLUDE_DEPTH: usize = 64;
/// Maximum nesting depth of blocks.
const MAX_BLOCK_DEPTH: usize = 10_000;

/// Receives the directives of a scene in order.
pub trait Visitor {
    /// Takes one directive.
    fn directive(&mut self, directive: Directive, sources: &SourceMap, diagnostics: &mut Diagnostics);
}

impl<F: FnMut(Directive, &SourceMap, &mut Diagnostics)> Visitor for F {
    fn directive(&mut self, directive: Directive, sources: &SourceMap, diagnostics: &mut Diagnostics) {
        self(directive, sources, diagnostics);
    }
}

/// Parses a scene file and all included files.
pub fn parse_file(path: &Path, sources: &mut SourceMap, diagnostics: &mut Diagnostics, visitor: &mut dyn Visitor) {
    match sources.read(path) {
        Ok(file) => parse_source(file, path, sources, diagnostics, visitor),
        Err(error) => diagnostics.missing_file(path, error, None),
    }
}

/// Parses a text that is already in `sources`. File names are relative to the folder of `path`.
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

/// Identifies a file.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Block {
    Attribute,
    Object,
}

impl Block {
    fn begin(self) -> &'static str {
        match self {
            Block::Attribute => "AttributeBegin",
            Block::Object => "ObjectBegin",
        }
    }

    fn end(self) -> &'static str {
        match self {
            Block::Attribute => "AttributeEnd",
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
    /// True after a world directive before `WorldBegin` was reported.
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
                    self.arguments().report(error);
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

    fn arguments(&mut self) -> Arguments<'_> {
        Arguments { diagnostics: self.diagnostics }
    }

    fn fail(&mut self, span: Span, message: impl Into<String>) -> Result<(), Reported> {
        self.arguments().fail(span, message)
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
            "Translate" => D::Translate(self.arguments().numbers(lexer, keyword)?),
            "Scale" => D::Scale(self.arguments().numbers(lexer, keyword)?),
            "Rotate" => D::Rotate(self.arguments().numbers(lexer, keyword)?),
            "LookAt" => D::LookAt(self.arguments().numbers(lexer, keyword)?),
            "Transform" => D::Transform(self.arguments().matrix(lexer, keyword)?),
            "ConcatTransform" => D::ConcatTransform(self.arguments().matrix(lexer, keyword)?),
            "TransformTimes" => D::TransformTimes(self.arguments().numbers(lexer, keyword)?.map(|t| t as f32)),
            "ActiveTransform" => D::ActiveTransform(self.arguments().active_times(lexer)?),
            "CoordinateSystem" => D::CoordinateSystem(self.arguments().name(lexer, keyword)?),
            "CoordSysTransform" => D::CoordSysTransform(self.arguments().name(lexer, keyword)?),
            "ReverseOrientation" => D::ReverseOrientation,
            "WorldBegin" => return self.world_begin(span),
            "WorldEnd" => {
                self.arguments().v3(span, "WorldEnd is not used by pbrt-v4");
                D::WorldEnd
            }
            "AttributeBegin" => return self.open_block(Block::Attribute, D::AttributeBegin, span),
            "TransformBegin" => {
                let message =
                    "TransformBegin is AttributeBegin in pbrt-v4: its end restores materials and all else as well";
                self.diagnostics.warning_first(span, message);
                return self.open_block(Block::Attribute, D::AttributeBegin, span);
            }
            "ObjectBegin" => {
                let name = self.arguments().name(lexer, keyword)?;
                return self.open_block(Block::Object, D::ObjectBegin(name), span);
            }
            "AttributeEnd" | "TransformEnd" => return self.close_block(Block::Attribute, D::AttributeEnd, span),
            "ObjectEnd" => return self.close_block(Block::Object, D::ObjectEnd, span),
            "ObjectInstance" => D::ObjectInstance(self.arguments().name(lexer, keyword)?),
            "ColorSpace" => D::ColorSpace(self.arguments().name(lexer, keyword)?),
            "NamedMaterial" => D::NamedMaterial(self.arguments().name(lexer, keyword)?),
            "MediumInterface" => self.arguments().medium_interface(lexer)?,
            "Include" | "Import" => return self.include(lexer, keyword, span),
            _ => return self.with_params(lexer, keyword, span),
        };
        self.emit(kind, span, ParamSet::new(keyword, span));
        Ok(())
    }

    /// Parses directives that end in a parameter list.
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
                let (name, value, class) = (
                    self.arguments().name(lexer, keyword)?,
                    self.arguments().name(lexer, keyword)?,
                    self.arguments().name(lexer, keyword)?,
                );
                let params = self.arguments().params(lexer, format!("Texture \"{}\"", class.text), span);
                self.emit(D::Texture { name, value, class }, span, params);
                return Ok(());
            }
            "Attribute" => {
                let name = self.arguments().name(lexer, keyword)?;
                let params = self.arguments().params(lexer, format!("Attribute \"{}\"", name.text), span);
                let target = self.arguments().attribute_target(&name)?;
                self.emit(D::Attribute(target), span, params);
                return Ok(());
            }
            "Option" => return self.option(lexer, span),
            _ => return self.unknown_directive(keyword, span),
        };
        let name = self.arguments().name(lexer, keyword)?;
        let params = self.arguments().params(lexer, format!("{keyword} \"{}\"", name.text), span);
        self.emit(make(name), span, params);
        Ok(())
    }

    /// `Option "name" value`; files for Lumiris may use typed parameters there, as for other directives.
    fn option(&mut self, lexer: &mut Lexer<'_>, span: Span) -> Result<(), Reported> {
        let position = lexer.position();
        let name = self.arguments().name(lexer, "Option")?;
        if !name.text.trim().contains(|c: char| c.is_ascii_whitespace()) {
            let value = self.arguments().option_value(lexer)?;
            self.emit(DirectiveKind::Option { name, value }, span, ParamSet::new("Option", span));
            return Ok(());
        }
        lexer.rewind(position);
        let params = self.arguments().params(lexer, "Option".to_owned(), span);
        let message = "an option of pbrt-v4 has no type: Option \"name\" value";
        self.diagnostics.warning_first(name.span, message);
        for param in params.iter() {
            let Some(text) = param.values.only() else {
                let message = format!("an option takes one value, not {}", param.values.len());
                return self.fail(param.value_span, message);
            };
            let name = Name { text: param.name.clone(), span: param.span };
            let value = Name { text, span: param.value_span };
            self.emit(DirectiveKind::Option { name, value }, span, ParamSet::new("Option", span));
        }
        Ok(())
    }

    fn unknown_directive(&mut self, keyword: &str, span: Span) -> Result<(), Reported> {
        let diagnostic = self.diagnostics.error(span, format!("unknown directive `{}`", shorten(keyword)));
        if let Some(near) = did_you_mean(keyword, KEYWORDS.iter().copied()) {
            diagnostic.help(format!("did you mean `{near}`?"));
        }
        Err(Reported)
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
        let name = self.arguments().verbatim_name(lexer, keyword)?;
        let path = file_in(&self.folder, &name.text);
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
        // State changes in an imported file are local to it, as in a block.
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

    /// Closes the block of an import and all blocks that the imported file left open.
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
}

/// Skips to the next keyword.
fn skip_to_directive(lexer: &mut Lexer<'_>) {
    skip_until(lexer, is_keyword);
}
