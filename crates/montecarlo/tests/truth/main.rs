//! The walks against what others have found: closed forms, adding-doubling, MCML, and each other.

#[cfg(test)]
mod chandrasekhar;
#[cfg(test)]
mod closed_forms;
#[cfg(test)]
mod engine;
#[cfg(test)]
mod mcml;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod statistics;
#[cfg(test)]
mod totals;
#[cfg(test)]
mod walks;
