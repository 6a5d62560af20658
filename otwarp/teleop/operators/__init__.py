"""What operators do: which hand moves which traps, what it feels, and the servo between."""
