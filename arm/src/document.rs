//! A file as a tree of values: TOML or JSON text, not yet checked for meaning.
//!
//! Both formats become the same tree, so that one walker (`reader`) checks both. A TOML value carries its line.
//! JSON is read by a visitor of our own, because the ready-made one keeps the last of two equal keys silently and
//! loses the key of a number that is not JSON (`NaN`, as Python writes it).
use crate::{Fault, Faults};
use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use std::cell::RefCell;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Longest text file that is read; the largest trajectory takes a fifth of it.
pub(crate) const TEXT_BYTES_MAX: u64 = 1 << 20;

/// Longest piece of a hostile file that is repeated in a fault, in characters.
const SHOWN_CHARS_MAX: usize = 60;

/// A value and its pose.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) value: Value,
    pub(crate) line: Option<usize>,
}

/// What stands in a file.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Flag(bool),
    /// Kept apart from numbers: a node id of 1.5 is a fault, and 64-bit integers lose digits as f64.
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Table(Vec<Entry>),
    /// Something that no key of ours takes: null, a date.
    Other(String),
}

impl Value {
    /// The texts of a list that holds nothing else.
    pub(crate) fn texts(&self) -> Option<Vec<String>> {
        let Self::List(items) = self else { return None };
        let text = |item: &Node| if let Self::Text(text) = &item.value { Some(text.clone()) } else { None };
        items.iter().map(text).collect()
    }
}

/// A key of a table and its value.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) node: Node,
}

impl fmt::Display for Node {
    /// The value as a fault shows it: one line, without control characters, never long.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match &self.value {
            Value::Flag(flag) => flag.to_string(),
            Value::Integer(integer) => integer.to_string(),
            Value::Number(number) => format!("{number:?}"),
            Value::Text(text) => shown(text),
            Value::List(nodes) => list_shown(nodes),
            Value::Table(_) => "a table".to_owned(),
            Value::Other(what) => what.clone(),
        };
        f.write_str(&text)
    }
}

/// Hostile text as a fault shows it: quoted, escaped, cut.
pub(crate) fn shown(text: &str) -> String {
    let mut cut: String = text.chars().take(SHOWN_CHARS_MAX).collect();
    if cut.len() < text.len() {
        cut.push_str("..");
    }
    format!("{cut:?}")
}

/// Lists within lists are only counted: showing them would grow without bound.
fn list_shown(nodes: &[Node]) -> String {
    let mut items: Vec<String> = Vec::new();
    for node in nodes.iter().take(MAX_ITEMS_SHOWN) {
        items.push(if let Value::List(inner) = &node.value {
            format!("a list of {}", inner.len())
        } else {
            node.to_string()
        });
    }
    let rest = nodes.len().saturating_sub(MAX_ITEMS_SHOWN);
    if rest > 0 {
        items.push(format!("and {rest} more"));
    }
    format!("[{}]", items.join(", "))
}

/// Items of a list that a fault shows: one a joint.
const MAX_ITEMS_SHOWN: usize = 8;

/// Reads a regular file of at most `bytes_max` bytes. `what` says what the file should have been.
pub(crate) fn read_file(file: &Path, bytes_max: u64, what: &str) -> Result<Vec<u8>, Faults> {
    let fault = |value: &str, expected: &str| Faults(vec![Fault::new(file, "", value, expected)]);
    let refused = |e: std::io::Error| {
        let missing = e.kind() == std::io::ErrorKind::NotFound;
        fault(&if missing { "no such file".to_owned() } else { format!("cannot be read ({e})") }, what)
    };
    if let Some(carried) = crate::shipped::bytes(file) {
        return Ok(carried.to_vec());
    }
    // A device or a pipe could block or never end, so it is turned away before it is opened.
    let metadata = std::fs::metadata(file).map_err(refused)?;
    if !metadata.is_file() {
        return Err(fault("not a regular file", what));
    }
    // One byte more than allowed tells a file that is too long from one that just fits, whatever its metadata says.
    let mut bytes = Vec::new();
    let mut source = std::fs::File::open(file).map_err(refused)?.take(bytes_max + 1);
    source.read_to_end(&mut bytes).map_err(refused)?;
    if bytes.len() as u64 > bytes_max {
        return Err(fault("too long", &format!("{what} of at most {bytes_max} bytes")));
    }
    Ok(bytes)
}

/// Reads a text file.
pub(crate) fn read_text(file: &Path, what: &str) -> Result<String, Faults> {
    read_text_of(file, TEXT_BYTES_MAX, what)
}

/// Reads a text file of at most `bytes_max` bytes; a byte order mark is dropped.
pub(crate) fn read_text_of(file: &Path, bytes_max: u64, what: &str) -> Result<String, Faults> {
    let bytes = read_file(file, bytes_max, what)?;
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        let expected = format!("{what} in UTF-8; save it in that encoding");
        return Err(Faults(vec![Fault::new(file, "", "UTF-16 text by its byte order mark", &expected)]));
    }
    let text = String::from_utf8(bytes).map(|text| match without_mark(&text) {
        bare if bare.len() == text.len() => text,
        bare => bare.to_owned(),
    });
    text.map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = e.as_bytes().iter().take(at).filter(|b| **b == b'\n').count() + 1;
        Faults(vec![Fault { line: Some(line), ..Fault::new(file, "", "not UTF-8 text", what) }])
    })
}

/// A text without the byte order mark that some programs write in front of it.
pub(crate) fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// A path of a file, as another file names it: relative to that file's folder.
pub(crate) fn beside(file: &Path, named: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(named)
}

/// Reads a TOML text. The syntax fault names the line.
pub(crate) fn parse_toml(file: &Path, text: &str) -> Result<Node, Faults> {
    let text = without_mark(text);
    let lines = Lines::of(text);
    match DeTable::parse(text) {
        Ok(table) => Ok(Node { value: from_table(table.get_ref(), &lines), line: None }),
        Err(e) => {
            let line = e.span().map(|span| lines.at(span.start));
            let fault = Fault::new(file, "", "not TOML", e.message().trim());
            Err(Faults(vec![Fault { line, ..fault }]))
        }
    }
}

/// Where lines begin, so that finding the line of a value is a search and not a count from the start.
pub(crate) struct Lines(Vec<usize>);

impl Lines {
    pub(crate) fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at).collect())
    }
    pub(crate) fn at(&self, byte: usize) -> usize {
        self.0.partition_point(|newline| *newline < byte) + 1
    }
}

fn from_table(table: &DeTable<'_>, lines: &Lines) -> Value {
    let entry = |(key, value): (&toml::Spanned<toml::de::DeString<'_>>, &toml::Spanned<DeValue<'_>>)| {
        let line = Some(lines.at(key.span().start));
        Entry {
            key: key.get_ref().to_string(),
            node: Node { value: from_value(value.get_ref(), lines), line },
        }
    };
    Value::Table(table.iter().map(entry).collect())
}

fn from_value(value: &DeValue<'_>, lines: &Lines) -> Value {
    match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        // An integer beyond 64 bits is beyond every bound too: infinity makes the walker say so.
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .map_or(Value::Number(f64::INFINITY), Value::Integer),
        // The parser let only floats through; should one not read back, it is refused like any NaN.
        DeValue::Float(float) => Value::Number(float.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Flag(*flag),
        DeValue::Datetime(date) => Value::Other(format!("the date {date}")),
        DeValue::Array(items) => Value::List(
            items
                .iter()
                .map(|item| Node {
                    value: from_value(item.get_ref(), lines),
                    line: Some(lines.at(item.span().start)),
                })
                .collect(),
        ),
        DeValue::Table(table) => from_table(table, lines),
    }
}

/// Reads a JSON text. The syntax fault names line, column and the key that was being read.
pub(crate) fn parse_json(file: &Path, text: &str) -> Result<Node, Faults> {
    let text = without_mark(text);
    let trail = PathTrail::default();
    let mut source = serde_json::Deserializer::from_str(text);
    let read =
        NodeSeed { trail: &trail }.deserialize(&mut source).and_then(|node| source.end().map(|()| node));
    match read {
        Ok(node) => match trail.twice.into_inner() {
            None => Ok(node),
            Some(key) => Err(Faults(vec![Fault::new(file, &key, "appears twice", "each key once")])),
        },
        Err(e) => {
            // The trail is left as it was when the reader gave up, and so names the value that is no JSON.
            let key = trail.keys.borrow().concat();
            let key = key.trim_start_matches('.');
            let expected = format!("JSON with finite numbers ({e})");
            let value =
                if e.is_eof() { "ends too early".to_owned() } else { token_at(text, e.line(), e.column()) };
            let fault = Fault::new(file, key, &value, &expected);
            Err(Faults(vec![Fault { line: Some(e.line()), ..fault }]))
        }
    }
}

/// The word of a text that a syntax error points into, such as `NaN`.
fn token_at(text: &str, line: usize, column: usize) -> String {
    let line = text.lines().nth(line.saturating_sub(1)).unwrap_or("");
    let ends = |b: u8| b.is_ascii_whitespace() || b",:{}[]".contains(&b);
    let column = column.saturating_sub(1).min(line.len());
    let (before, after) = line.as_bytes().split_at(column);
    let start = before.iter().rposition(|b| ends(*b)).map_or(0, |at| at + 1);
    let end = column + after.iter().position(|b| ends(*b)).unwrap_or(after.len());
    match line.get(start..end) {
        Some(word) if !word.is_empty() => shown(word).trim_matches('"').to_owned(),
        _ => "not JSON".to_owned(),
    }
}

/// Where in a JSON tree the reader is, and the first key that stood twice.
#[derive(Default)]
struct PathTrail {
    keys: RefCell<Vec<String>>,
    twice: RefCell<Option<String>>,
}

/// Reads one value with everything below it; nesting is bounded by the parser (128 levels).
struct NodeSeed<'t> {
    trail: &'t PathTrail,
}

impl<'de> DeserializeSeed<'de> for NodeSeed<'_> {
    type Value = Node;
    fn deserialize<D: Deserializer<'de>>(self, source: D) -> Result<Node, D::Error> {
        source.deserialize_any(self).map(|value| Node { value, line: None })
    }
}

impl<'de> Visitor<'de> for NodeSeed<'_> {
    type Value = Value;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }
    fn visit_bool<E>(self, flag: bool) -> Result<Value, E> {
        Ok(Value::Flag(flag))
    }
    fn visit_i64<E>(self, integer: i64) -> Result<Value, E> {
        Ok(Value::Integer(integer))
    }
    fn visit_u64<E>(self, integer: u64) -> Result<Value, E> {
        Ok(i64::try_from(integer).map_or(Value::Number(integer as f64), Value::Integer))
    }
    fn visit_f64<E>(self, number: f64) -> Result<Value, E> {
        Ok(Value::Number(number))
    }
    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }
    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Other("null".to_owned()))
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut source: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        loop {
            self.trail.keys.borrow_mut().push(format!("[{}]", items.len()));
            let Some(item) = source.next_element_seed(NodeSeed { trail: self.trail })? else { break };
            self.trail.keys.borrow_mut().pop();
            items.push(item);
        }
        self.trail.keys.borrow_mut().pop();
        Ok(Value::List(items))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut source: A) -> Result<Value, A::Error> {
        let mut entries: Vec<Entry> = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        while let Some(key) = source.next_key::<String>()? {
            self.trail.keys.borrow_mut().push(format!(".{}", key_shown(&key)));
            // Reading continues: a later syntax fault matters more.
            if !seen.insert(key.clone()) {
                let path = self.trail.keys.borrow().concat();
                self.trail.twice.borrow_mut().get_or_insert(path.trim_start_matches('.').to_owned());
            }
            let node = source.next_value_seed(NodeSeed { trail: self.trail })?;
            self.trail.keys.borrow_mut().pop();
            entries.push(Entry { key, node });
        }
        Ok(Value::Table(entries))
    }
}

/// A key as paths show it: bare where it is a plain word, else quoted, escaped and cut.
pub(crate) fn key_shown(key: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
    if (1..=SHOWN_CHARS_MAX).contains(&key.len()) && key.bytes().all(plain) {
        key.to_owned()
    } else {
        shown(key)
    }
}
