"""The tutorial is a notebook; the site shows its cells as a page and offers the notebook beside it."""

import json
from pathlib import Path

from mkdocs.structure.files import File

NOTE = "This page is a notebook: [tutorial.ipynb](tutorial.ipynb). Run it in Jupyter to see tables and figures."


def on_files(files, config):
    notebook = json.loads((Path(config["docs_dir"]) / "tutorial.ipynb").read_text(encoding="utf-8"))
    files.append(File.generated(config, "tutorial.md", content=page(notebook)))
    return files


def page(notebook):
    """The cells as Markdown, with the note under the title."""
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    parts.insert(1, NOTE)
    return "\n\n".join(parts) + "\n"
