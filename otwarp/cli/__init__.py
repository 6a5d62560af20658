"""Command line: one thin command per capability, each also one Python call. Open `main` first.

What was typed comes in; a call of the room that can do it, its result as text or JSON, and an exit code go out. Each
command lives in the module of its name and imports its room when it is called, so that `--help` loads nothing.

- `start`: where it begins. `main`: finds the command, and turns errors into one line and an exit code; `lazy`: groups
  that import on demand. `types`: numbers in a range, files that can be written.
- `options`: what several commands ask alike.
- `output`: JSON and tables. `progress`: a bar. `stop`: SIGTERM and Ctrl-C.
- Commands: `new`, `import_`, `forces`, `validate`, `info`, `mobility`, `run`, `analyse`, `preview`, `view`, `edit`,
  `export`, `teleop`, `ros1`, `ros2`, `decompose`, `reproduce`; `scenes`, `study`, `vision`, `bench`, `haptics`,
  `operators`, `envs`: groups of commands.
"""
