//! Walks a tree of values and adds every fault to a list, so that a file can be fixed at once.
//!
//! A [`Table`] hands out its keys one by one; a key that is not requested is unknown. A getter returns `None` after
//! noting the fault, and the caller continues to the next key: a description is only built when the list is empty.
use crate::document::{Entry, Node, Value, key_shown, shown};
use crate::{Fault, Faults};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Most faults that are kept: a file of a million unknown keys must not become a million sentences.
const FAULTS_MAX: usize = 100;

/// The faults found so far in one file.
pub(crate) struct FaultList {
    file: PathBuf,
    faults: RefCell<Vec<Fault>>,
    /// How many were left out.
    further: RefCell<usize>,
}

impl FaultList {
    pub(crate) fn new(file: &Path) -> Self {
        Self { file: file.to_owned(), faults: RefCell::default(), further: RefCell::default() }
    }
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }
    /// Notes one fault.
    pub(crate) fn add(&self, line: Option<usize>, key: &str, value: &str, expected: &str) {
        self.push(Fault { line, ..Fault::new(&self.file, key, value, expected) });
    }
    /// Takes over the faults of a file that this one names.
    pub(crate) fn merge(&self, faults: Faults) {
        faults.0.into_iter().for_each(|fault| self.push(fault));
    }
    fn push(&self, fault: Fault) {
        let mut faults = self.faults.borrow_mut();
        if faults.len() < FAULTS_MAX {
            faults.push(fault);
        } else {
            *self.further.borrow_mut() += 1;
        }
    }
    /// True while no fault was noted: only then may something be built of what was read.
    pub(crate) fn is_clean(&self) -> bool {
        self.faults.borrow().is_empty()
    }
    /// All faults, or the value when there are none and it could be built.
    pub(crate) fn close<T>(self, value: Option<T>) -> Result<T, Faults> {
        let mut faults = self.faults.into_inner();
        let further = self.further.into_inner();
        if further > 0 {
            let more = format!("{further} more faults");
            faults.push(Fault::new(&self.file, "", &more, "these to be fixed first"));
        }
        match value {
            Some(value) if faults.is_empty() => Ok(value),
            _ if !faults.is_empty() => Err(Faults(faults)),
            // A reader that gave up without a fault is our own mistake; it must not pass for a good file.
            _ => Err(Faults(vec![Fault::new(&self.file, "", "incomplete", "every required key")])),
        }
    }
}

/// What a number may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    low: f64,
    high: f64,
    low_excluded: bool,
    unit: &'static str,
}

impl Bounds {
    /// From `low` to `high`, both allowed.
    pub(crate) const fn within(low: f64, high: f64, unit: &'static str) -> Self {
        Self { low, high, low_excluded: false, unit }
    }
    /// Above `low`, up to `high`.
    pub(crate) const fn above(low: f64, high: f64, unit: &'static str) -> Self {
        Self { low, high, low_excluded: true, unit }
    }
    pub(crate) fn hold(&self, number: f64) -> bool {
        // NaN fails every comparison, so it is out of any bounds.
        let low_kept = if self.low_excluded { number > self.low } else { number >= self.low };
        number.is_finite() && low_kept && number <= self.high
    }
    pub(crate) fn words(&self) -> String {
        let (low, high, unit) = (self.low, self.high, self.unit);
        let range = if self.low_excluded {
            format!("above {low} up to {high}")
        } else {
            format!("from {low} to {high}")
        };
        if unit.is_empty() {
            format!("a finite number {range}")
        } else {
            format!("a finite number {range} {unit}")
        }
    }
}

/// A number of a node, noting what is wrong with it.
pub(crate) fn number_of(fault_list: &FaultList, key: &str, node: &Node, bounds: &Bounds) -> Option<f64> {
    let number = match &node.value {
        Value::Number(number) => *number,
        // Exact for every integer that any bounds of ours let through.
        Value::Integer(integer) => *integer as f64,
        Value::Flag(_) | Value::Text(_) | Value::List(_) | Value::Table(_) | Value::Other(_) => f64::NAN,
    };
    if bounds.hold(number) {
        return Some(number);
    }
    fault_list.add(node.line, key, &node.to_string(), &bounds.words());
    None
}

/// Exactly `count` numbers of a node.
pub(crate) fn numbers_of(
    fault_list: &FaultList,
    key: &str,
    node: &Node,
    count: usize,
    bounds: &Bounds,
) -> Option<Vec<f64>> {
    let Value::List(items) = &node.value else {
        fault_list.add(node.line, key, &node.to_string(), &format!("a list of {count} numbers"));
        return None;
    };
    if items.len() != count {
        let value = format!("{node} ({} values)", items.len());
        fault_list.add(node.line, key, &value, &format!("a list of {count} numbers"));
        return None;
    }
    let read = |(i, item): (usize, &Node)| number_of(fault_list, &format!("{key}[{i}]"), item, bounds);
    // Every item is looked at, so that two bad ones are two faults.
    let numbers: Vec<Option<f64>> = items.iter().enumerate().map(read).collect();
    numbers.into_iter().collect()
}

/// A key that was requested, whether it was there, and its line.
struct RequestedKey {
    key: &'static str,
    there: bool,
    line: Option<usize>,
}

/// One table of a file, handed out key by key.
pub(crate) struct Table<'b> {
    fault_list: &'b FaultList,
    path: String,
    line: Option<usize>,
    entries: Vec<Entry>,
    requested: Vec<RequestedKey>,
}

impl<'b> Table<'b> {
    /// The table at the top of a file, or a fault.
    pub(crate) fn top(fault_list: &'b FaultList, node: Node) -> Option<Self> {
        Self::from_node(fault_list, String::new(), node)
    }
    fn from_node(fault_list: &'b FaultList, path: String, node: Node) -> Option<Self> {
        if let Value::Table(entries) = node.value {
            return Some(Self { fault_list, path, line: node.line, entries, requested: Vec::new() });
        }
        fault_list.add(node.line, &path, &node.to_string(), "a table");
        None
    }
    pub(crate) fn fault_list(&self) -> &'b FaultList {
        self.fault_list
    }
    /// The path of one of its keys from the top of the file.
    pub(crate) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
    /// Notes a fault of one of its keys (of the table itself when the key is empty).
    pub(crate) fn fault(&self, key: &str, value: &str, expected: &str) {
        let path = if key.is_empty() { self.path.clone() } else { self.path_of(key) };
        let at =
            self.requested.iter().find(|requested| requested.key == key).and_then(|requested| requested.line);
        self.fault_list.add(at.or(self.line), &path, value, expected);
    }
    /// True when a key stood there, whatever it held.
    pub(crate) fn had(&self, key: &str) -> bool {
        self.requested.iter().any(|requested| requested.key == key && requested.there)
    }
    /// True when a key stands there and was not taken yet.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|entry| entry.key == key)
    }
    /// The value of a key, if it stands there.
    pub(crate) fn take(&mut self, key: &'static str) -> Option<Node> {
        // The order of what is left does not matter: it can only be unknown keys.
        let at = self.entries.iter().position(|entry| entry.key == key);
        let node = at.map(|at| self.entries.swap_remove(at).node);
        let line = node.as_ref().and_then(|node| node.line);
        self.requested.push(RequestedKey { key, there: node.is_some(), line });
        node
    }
    /// The value of a key; its absence is a fault.
    pub(crate) fn need(&mut self, key: &'static str, expected: &str) -> Option<Node> {
        let node = self.take(key);
        if node.is_none() {
            self.fault(key, "missing", expected);
        }
        node
    }
    /// The number of a key; its absence is a fault.
    pub(crate) fn number(&mut self, key: &'static str, bounds: &Bounds) -> Option<f64> {
        let node = self.need(key, &bounds.words())?;
        number_of(self.fault_list, &self.path_of(key), &node, bounds)
    }
    /// The number, or the default when the key is absent; `None` only after a fault.
    pub(crate) fn number_or(&mut self, key: &'static str, default: f64, bounds: &Bounds) -> Option<f64> {
        match self.take(key) {
            None => Some(default),
            Some(node) => number_of(self.fault_list, &self.path_of(key), &node, bounds),
        }
    }
    /// Exactly `N` numbers; their absence is a fault.
    pub(crate) fn numbers<const N: usize>(&mut self, key: &'static str, bounds: &Bounds) -> Option<[f64; N]> {
        let node = self.need(key, &format!("a list of {N} numbers"))?;
        numbers_of(self.fault_list, &self.path_of(key), &node, N, bounds)?.try_into().ok()
    }
    /// Exactly `N` numbers, or the default when the key is absent; `None` only after a fault.
    pub(crate) fn numbers_or<const N: usize>(
        &mut self,
        key: &'static str,
        default: [f64; N],
        bounds: &Bounds,
    ) -> Option<[f64; N]> {
        match self.take(key) {
            None => Some(default),
            Some(node) => numbers_of(self.fault_list, &self.path_of(key), &node, N, bounds)?.try_into().ok(),
        }
    }
    /// Two finite numbers, the first below the second.
    pub(crate) fn interval(&mut self, key: &'static str, bounds: &Bounds) -> Option<[f64; 2]> {
        let [low, high] = self.numbers(key, bounds)?;
        if low < high {
            return Some([low, high]);
        }
        self.fault(
            key,
            &format!("[{low:?}, {high:?}]"),
            "[lowest, highest] with the lowest below the highest",
        );
        None
    }
    /// The integer of a key; its absence is a fault, and so is a number with a point.
    pub(crate) fn integer(&mut self, key: &'static str, low: i64, high: i64) -> Option<i64> {
        let node = self.need(key, &format!("an integer from {low} to {high}"))?;
        self.integer_of(key, &node, low, high)
    }
    /// The integer, or the default when the key is absent; `None` only after a fault.
    pub(crate) fn integer_or(&mut self, key: &'static str, default: i64, low: i64, high: i64) -> Option<i64> {
        match self.take(key) {
            None => Some(default),
            Some(node) => self.integer_of(key, &node, low, high),
        }
    }
    /// The integer of a key that may be absent; the outer `None` only after a fault.
    pub(crate) fn integer_if_there(&mut self, key: &'static str, low: i64, high: i64) -> Option<Option<i64>> {
        match self.take(key) {
            None => Some(None),
            Some(node) => self.integer_of(key, &node, low, high).map(Some),
        }
    }
    fn integer_of(&self, key: &str, node: &Node, low: i64, high: i64) -> Option<i64> {
        if let Value::Integer(integer) = node.value
            && (low..=high).contains(&integer)
        {
            return Some(integer);
        }
        self.refuse(key, node, &format!("an integer from {low} to {high}"))
    }
    /// True or false; never taken from a number or a word.
    pub(crate) fn flag(&mut self, key: &'static str) -> Option<bool> {
        let node = self.need(key, "true or false")?;
        self.flag_of(key, &node)
    }
    /// True or false, or the default when the key is absent; `None` only after a fault.
    pub(crate) fn flag_or(&mut self, key: &'static str, default: bool) -> Option<bool> {
        match self.take(key) {
            None => Some(default),
            Some(node) => self.flag_of(key, &node),
        }
    }
    fn flag_of(&self, key: &str, node: &Node) -> Option<bool> {
        if let Value::Flag(flag) = node.value {
            return Some(flag);
        }
        self.refuse(key, node, "true or false")
    }
    /// A text that is not empty; its absence is a fault.
    pub(crate) fn text(&mut self, key: &'static str, expected: &str) -> Option<String> {
        let node = self.need(key, expected)?;
        self.text_of(key, &node, expected)
    }
    /// The text, or none when the key is absent; `None` also after a fault.
    pub(crate) fn text_if_there(&mut self, key: &'static str, expected: &str) -> Option<String> {
        let node = self.take(key)?;
        self.text_of(key, &node, expected)
    }
    /// One of several choices by its word; `None` only after a fault.
    pub(crate) fn choice<T: Copy>(
        &mut self,
        key: &'static str,
        expected: &str,
        (all, word): (&[T], fn(T) -> &'static str),
    ) -> Option<T> {
        let text = self.text(key, expected)?;
        self.chosen(key, expected, &text, (all, word))
    }
    /// The same with what holds where the key is absent.
    pub(crate) fn choice_or<T: Copy>(
        &mut self,
        key: &'static str,
        expected: &str,
        absent: T,
        (all, word): (&[T], fn(T) -> &'static str),
    ) -> Option<T> {
        let Some(text) = self.text_if_there(key, expected) else {
            return (!self.had(key)).then_some(absent);
        };
        self.chosen(key, expected, &text, (all, word))
    }
    fn chosen<T: Copy>(
        &mut self,
        key: &'static str,
        expected: &str,
        text: &str,
        (all, word): (&[T], fn(T) -> &'static str),
    ) -> Option<T> {
        let known = all.iter().copied().find(|choice| word(*choice) == text);
        if known.is_none() {
            self.fault(key, &shown(text), expected);
        }
        known
    }
    fn text_of(&self, key: &str, node: &Node, expected: &str) -> Option<String> {
        if let Value::Text(text) = &node.value
            && !text.is_empty()
        {
            return Some(text.clone());
        }
        self.refuse(key, node, expected)
    }
    fn refuse<T>(&self, key: &str, node: &Node, expected: &str) -> Option<T> {
        self.fault_list.add(node.line, &self.path_of(key), &node.to_string(), expected);
        None
    }
    /// A name: it goes into messages, file names and tables, so it is a plain word.
    pub(crate) fn name(&mut self, key: &'static str) -> Option<String> {
        let node = self.need(key, NAME_WORDS)?;
        self.name_of(key, &node)
    }
    /// The name, or the default when the key is absent; `None` only after a fault.
    pub(crate) fn name_or(&mut self, key: &'static str, default: String) -> Option<String> {
        match self.take(key) {
            None => Some(default),
            Some(node) => self.name_of(key, &node),
        }
    }
    fn name_of(&self, key: &str, node: &Node) -> Option<String> {
        let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-' || b == b'.';
        if let Value::Text(name) = &node.value
            && (1..=NAME_BYTES_MAX).contains(&name.len())
            && name.bytes().all(plain)
        {
            return Some(name.clone());
        }
        self.refuse(key, node, NAME_WORDS)
    }
    /// A table inside this one; its absence is a fault.
    pub(crate) fn table(&mut self, key: &'static str, expected: &str) -> Option<Table<'b>> {
        let node = self.need(key, expected)?;
        Self::from_node(self.fault_list, self.path_of(key), node)
    }
    /// A table inside this one, or none.
    pub(crate) fn table_if_there(&mut self, key: &'static str) -> Option<Table<'b>> {
        let node = self.take(key)?;
        Self::from_node(self.fault_list, self.path_of(key), node)
    }
    /// The tables of a list (`[[key]]`); none when the key is absent.
    pub(crate) fn tables(&mut self, key: &'static str) -> Vec<Table<'b>> {
        let Some(node) = self.take(key) else { return Vec::new() };
        let Value::List(items) = node.value else {
            let expected = format!("a list of tables, each begun by [[{key}]]");
            self.fault_list.add(node.line, &self.path_of(key), &node.to_string(), &expected);
            return Vec::new();
        };
        let table = |(i, item)| Self::from_node(self.fault_list, self.path_of(&format!("{key}[{i}]")), item);
        items.into_iter().enumerate().filter_map(table).collect()
    }
    /// Notes the keys that were not requested.
    pub(crate) fn done(self) {
        let known: Vec<&str> = self.requested.iter().map(|requested| requested.key).collect();
        let expected = format!("no such key; known here are {}", known.join(", "));
        for entry in &self.entries {
            let path = self.path_of(&key_shown(&entry.key));
            self.fault_list.add(entry.node.line, &path, &entry.node.to_string(), &expected);
        }
    }
}

/// Longest name.
pub(crate) const NAME_BYTES_MAX: usize = 64;

const NAME_WORDS: &str = "a name of 1 to 64 letters, digits, '_', '-' or '.'";
