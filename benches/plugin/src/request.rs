//! [`Request`]: the parsed command line.

/// The parsed command line: numbers after options, a filter word, and whether to measure at all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// True if everything is only tried out, not measured.
    pub test: bool,
    /// The filter: only items with this word in their names run.
    pub word: Option<String>,
    numbers: Vec<(String, u32)>,
}

impl Request {
    /// Parses the command line; each of `options` is followed by a number.
    ///
    /// # Errors
    /// A sentence about the first argument that is not understood.
    pub fn parse(mut arguments: impl Iterator<Item = String>, options: &[&str]) -> Result<Self, String> {
        // As in criterion: without `cargo bench`, everything is only tried out.
        let mut request = Self { test: true, word: None, numbers: Vec::new() };
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--test" => request.test = true,
                "--bench" => request.test = false,
                option if options.contains(&option) => {
                    let value = arguments.next().unwrap_or_default();
                    let number = value.parse::<u32>();
                    let number =
                        number.map_err(|_| format!("{option} needs a number, but it is followed by {value:?}"))?;
                    request.numbers.push((argument, number.max(1)));
                }
                word if !word.starts_with('-') => request.word = Some(word.to_owned()),
                unknown => {
                    let options: String = options.iter().map(|option| format!("{option} N, ")).collect();
                    return Err(format!("unknown: {unknown}; there are {options}--test and a word"));
                }
            }
        }
        Ok(request)
    }

    /// The number after an option, at least 1; the last one if it is given twice.
    pub fn number(&self, option: &str) -> Option<u32> {
        self.numbers.iter().rev().find(|(name, _)| name == option).map(|(_, number)| *number)
    }

    /// True if the filter includes this name.
    pub fn includes(&self, name: &str) -> bool {
        self.word.as_ref().is_none_or(|word| name.contains(word))
    }
}
