//! What a person does to a run, in the words of a scenario.

use config::Override;
use serde::Serialize;

use super::super::fault::Fault;
use super::super::network::{NamedFate, Network};
use super::fault::FaultTable;
use super::network::NetworkTable;

/// Sets all partitions of a network.
pub(crate) fn partitions(network: &Network, tick_s: f64) -> Result<Override, String> {
    list_of_network(network, tick_s, "partition")
}

/// Sets all commands of a network that have such a fate by their numbers.
pub(crate) fn named(network: &Network, fate: NamedFate, tick_s: f64) -> Result<Override, String> {
    let list = match fate {
        NamedFate::Lost => "lose",
        NamedFate::Late(_) => "delay",
        NamedFate::Doubled => "duplicate",
    };
    list_of_network(network, tick_s, list)
}

fn list_of_network(network: &Network, tick_s: f64, name: &str) -> Result<Override, String> {
    let table = NetworkTable::of(network, tick_s)
        .map(to_value)
        .transpose()?;
    let list = table.and_then(|table| table.get(name).cloned());
    let list = list.unwrap_or_else(|| toml::Value::Array(Vec::new()));
    Ok(Override::new(&["network", name], list))
}

/// Sets all faults of a run.
pub(crate) fn faults(faults: &[Fault], tick_s: f64) -> Result<Override, String> {
    let mut tables = Vec::new();
    for fault in faults {
        tables.push(to_value(FaultTable::of(fault, tick_s))?);
    }
    Ok(Override::new(&["fault"], toml::Value::Array(tables)))
}

/// Sets what the clock does about late robots.
pub(crate) fn on_late(path: &[&str], rule: impl Serialize) -> Result<Override, String> {
    Ok(Override::new(path, to_value(rule)?))
}

fn to_value(table: impl Serialize) -> Result<toml::Value, String> {
    toml::Value::try_from(table).map_err(|error| error.to_string())
}
