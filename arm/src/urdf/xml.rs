//! Elements of an XML file, handed out one by one; what is wrong with them goes into a book.
use crate::document::{self, Lines, Node, Value, key_shown, shown};
use crate::reader::{Bounds, FaultList, number_of, numbers_of};
use crate::{Fault, Faults};
use roxmltree::{Document, ParsingOptions};
use std::path::Path;

/// Longest URDF or SRDF file; the largest in use are about a megabyte.
const BYTES_MAX: u64 = 8 << 20;
/// Most elements, texts and comments.
const NODES_MAX: u32 = 400_000;
/// Longest tag: attributes are compared with each other, so that a tag of a million of them would take hours.
const TAG_BYTES_MAX: usize = 8 << 10;
/// Deepest nesting; URDF needs six levels.
const DEPTH_MAX: usize = 64;
/// Longest name of a robot, link or joint.
const NAME_BYTES_MAX: usize = 128;
const XACRO: &str = "http://www.ros.org/wiki/xacro";

/// Reads a text file of bounded length.
pub(crate) fn read(file: &Path, what: &str) -> Result<String, Faults> {
    document::read_text_of(file, BYTES_MAX, what)
}

/// Parses a text; document type declarations, and with them entities, are refused.
pub(crate) fn parse<'t>(file: &Path, text: &'t str) -> Result<Document<'t>, Faults> {
    let fault = |line: usize, value: &str, expected: &str| {
        Faults(vec![Fault { line: Some(line), ..Fault::new(file, "", value, expected) }])
    };
    if let Some(line) = too_wild(text) {
        let expected = format!("tags of at most {TAG_BYTES_MAX} bytes, nested at most {DEPTH_MAX} deep");
        return Err(fault(line, "too long a tag, or too deep a nesting", &expected));
    }
    let options = ParsingOptions { allow_dtd: false, nodes_limit: NODES_MAX, ..ParsingOptions::default() };
    let parsed = Document::parse_with_options(text, options);
    let parsed = parsed.map_err(|e| {
        // An expanded file has no use for the prefix any more, and often has lost its declaration.
        let hint = if text.contains("xacro:") {
            "; if this is a xacro template, expand it: xacro FILE > robot.urdf"
        } else {
            ""
        };
        fault(
            usize::try_from(e.pos().row).unwrap_or(0),
            "not XML",
            &format!("well-formed XML without a document type ({e}){hint}"),
        )
    })?;
    match parsed.descendants().find(|n| n.is_element() && n.tag_name().namespace() == Some(XACRO)) {
        None => Ok(parsed),
        Some(node) => {
            let line = Lines::of(text).at(node.range().start);
            let value = format!("the xacro element {}", shown(node.tag_name().name()));
            Err(fault(line, &value, "a URDF without templates; expand it first: xacro FILE > robot.urdf"))
        }
    }
}

/// The line of a tag that is too long or too deep, counted without a parser, whose own work it would be to survive it.
fn too_wild(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut depth, mut at) = (0_usize, 0);
    while let Some(open) =
        bytes.get(at..).and_then(|rest| rest.iter().position(|b| *b == b'<')).map(|i| at + i)
    {
        let rest = bytes.get(open..).unwrap_or_default();
        let (length, is_element) = markup(rest);
        let tag = rest.get(..length).unwrap_or_default();
        if tag.starts_with(b"</") {
            depth = depth.saturating_sub(1);
        } else if is_element && !tag.ends_with(b"/>") {
            depth += 1;
        }
        if (is_element && length > TAG_BYTES_MAX) || depth > DEPTH_MAX {
            return Some(Lines::of(text).at(open));
        }
        at = open + length;
    }
    None
}

/// Length of the markup that a text begins with, and whether it is a tag. A comment or CDATA section may be long, and
/// holds no tags. An open end is the parser's to name.
fn markup(rest: &[u8]) -> (usize, bool) {
    for (begin, end) in [(&b"<!--"[..], &b"-->"[..]), (b"<![CDATA[", b"]]>"), (b"<?", b"?>")] {
        if rest.starts_with(begin) {
            let length = rest.windows(end.len()).position(|w| w == end).map_or(rest.len(), |i| i + end.len());
            return (length, false);
        }
    }
    let mut quote = None;
    for (i, byte) in rest.iter().enumerate() {
        match (quote, byte) {
            (None, b'>') => return (i + 1, true),
            (None, b'"' | b'\'') => quote = Some(*byte),
            (Some(open), byte) if open == *byte => quote = None,
            _ => {}
        }
    }
    (rest.len(), true)
}

/// What elements need besides themselves.
pub(crate) struct Context<'b> {
    pub(crate) fault_list: &'b FaultList,
    lines: Lines,
}

impl<'b> Context<'b> {
    pub(crate) fn new(fault_list: &'b FaultList, text: &str) -> Self {
        Self { fault_list, lines: Lines::of(text) }
    }
}

/// One element, and how it is called in faults.
#[derive(Clone)]
pub(crate) struct Element<'c, 'd, 't> {
    context: &'c Context<'c>,
    node: roxmltree::Node<'d, 't>,
    path: String,
}

impl<'c, 'd, 't> Element<'c, 'd, 't> {
    /// The outermost element, when it is called `robot`.
    pub(crate) fn robot(context: &'c Context<'c>, document: &'d Document<'t>) -> Option<Self> {
        let element = Self { context, node: document.root_element(), path: "robot".to_owned() };
        let tag = element.node.tag_name().name();
        if tag == "robot" {
            return Some(element);
        }
        context.fault_list.add(
            element.line(),
            "",
            &format!("the element {}", shown(tag)),
            "an element <robot>",
        );
        None
    }
    /// Its children of a kind. `path` makes the name of each from its own `name` or its number.
    pub(crate) fn children(&self, tag: &'static str) -> Vec<Self> {
        let found = self.node.children().filter(|n| n.is_element() && n.tag_name().name() == tag);
        let path = |i: usize, node: &roxmltree::Node| match node.attribute("name") {
            // At the top names say more than numbers; a nameless one is found by its line.
            Some(name) if self.path == "robot" => format!("{tag} {}", key_shown(name)),
            _ if self.path == "robot" => format!("{tag}[{i}]"),
            _ => format!("{}.{tag}[{i}]", self.path),
        };
        found
            .enumerate()
            .map(|(i, node)| Self { context: self.context, node, path: path(i, &node) })
            .collect()
    }
    /// The only child of a kind; a second one is a fault.
    pub(crate) fn child(&self, tag: &'static str) -> Option<Self> {
        let mut found = self.node.children().filter(|n| n.is_element() && n.tag_name().name() == tag);
        let first = found.next()?;
        if let Some(second) = found.next() {
            let line = self.context.lines.at(second.range().start);
            self.context.fault_list.add(
                Some(line),
                &format!("{}.{tag}", self.path),
                "given twice",
                "it once",
            );
        }
        Some(Self { context: self.context, node: first, path: format!("{}.{tag}", self.path) })
    }
    /// The only child of a kind; its absence is a fault.
    pub(crate) fn need(&self, tag: &'static str, expected: &str) -> Option<Self> {
        let child = self.child(tag);
        if child.is_none() {
            self.context.fault_list.add(self.line(), &format!("{}.{tag}", self.path), "missing", expected);
        }
        child
    }
    /// The tags of its child elements.
    pub(crate) fn tags(&self) -> Vec<&'d str> {
        self.node.children().filter(roxmltree::Node::is_element).map(|n| n.tag_name().name()).collect()
    }
    pub(crate) fn has(&self, attribute: &str) -> bool {
        self.node.attribute(attribute).is_some()
    }
    pub(crate) fn line(&self) -> Option<usize> {
        Some(self.context.lines.at(self.node.range().start))
    }
    pub(crate) fn path(&self) -> &str {
        &self.path
    }
    /// Notes a fault of one of its attributes, or of itself when the attribute is empty.
    pub(crate) fn fault(&self, attribute: &str, value: &str, expected: &str) {
        let path =
            if attribute.is_empty() { self.path.clone() } else { format!("{}.{attribute}", self.path) };
        self.context.fault_list.add(self.line(), &path, value, expected);
    }
    /// A text that is not empty; its absence is a fault.
    pub(crate) fn text(&self, attribute: &str, expected: &str) -> Option<String> {
        match self.node.attribute(attribute) {
            Some(text) if !text.trim().is_empty() => Some(text.trim().to_owned()),
            Some(text) => {
                self.fault(attribute, &shown(text), expected);
                None
            }
            None => {
                self.fault(attribute, "missing", expected);
                None
            }
        }
    }
    /// The name of a link or joint: any text of one line that is not too long.
    pub(crate) fn name(&self, attribute: &str) -> Option<String> {
        const EXPECTED: &str = "a name of 1 to 128 bytes without control characters";
        let name = self.text(attribute, EXPECTED)?;
        if name.len() <= NAME_BYTES_MAX && !name.chars().any(char::is_control) {
            return Some(name);
        }
        self.fault(attribute, &shown(&name), EXPECTED);
        None
    }
    /// A number; its absence is a fault.
    pub(crate) fn number(&self, attribute: &str, bounds: &Bounds) -> Option<f64> {
        let Some(text) = self.node.attribute(attribute) else {
            self.fault(attribute, "missing", "a number");
            return None;
        };
        let path = format!("{}.{attribute}", self.path);
        number_of(self.context.fault_list, &path, &self.number_node(text), bounds)
    }
    /// A number or the default; `None` only after a fault.
    pub(crate) fn number_or(&self, attribute: &str, default: f64, bounds: &Bounds) -> Option<f64> {
        if self.has(attribute) { self.number(attribute, bounds) } else { Some(default) }
    }
    /// Three numbers apart by blanks; their absence is a fault.
    pub(crate) fn vector(&self, attribute: &str, bounds: &Bounds) -> Option<[f64; 3]> {
        let Some(text) = self.node.attribute(attribute) else {
            self.fault(attribute, "missing", "three numbers apart by blanks");
            return None;
        };
        let items: Vec<Node> = text.split_whitespace().map(|word| self.number_node(word)).collect();
        let node = Node { value: Value::List(items), line: self.line() };
        let path = format!("{}.{attribute}", self.path);
        numbers_of(self.context.fault_list, &path, &node, 3, bounds)?.try_into().ok()
    }
    /// Three numbers or the default; `None` only after a fault.
    pub(crate) fn vector_or(&self, attribute: &str, default: [f64; 3], bounds: &Bounds) -> Option<[f64; 3]> {
        if self.has(attribute) { self.vector(attribute, bounds) } else { Some(default) }
    }
    fn number_node(&self, text: &str) -> Node {
        let text = text.trim();
        let value = text.parse().map_or_else(|_| Value::Text(text.to_owned()), Value::Number);
        Node { value, line: self.line() }
    }
}
