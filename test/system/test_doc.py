# SPDX-License-Identifier: BSD-3-Clause
# The pages: tables that are made are as they would be made now, links lead somewhere, files and targets that are named exist, every
# message in doc/troubleshooting.md stands in the source, and the README keeps to its width.
import glob
import os
import re
import subprocess
import sys
import tempfile

B = os.environ["B"]
PAGES = sorted(glob.glob("*.md") + glob.glob("doc/**/*.md", recursive=True))
failed = False


def verdict(name, wrong):
    global failed
    print(f"ok {name}" if not wrong else "  " + "\n  ".join(wrong) + f"\nFAIL {name}", flush=True)
    failed |= bool(wrong)


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def check_made():
    try:
        import cantools  # noqa: F401
    except ImportError:
        print("skip made_pages_are_of_today: cantools is not here; make test installs it into build/venv")
        return
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "tools/doc_pages.py", B, folder], check=True)
        verdict("made_pages_are_of_today", [f"doc/{name} is older than what it is made of; make doc" for name in sorted(os.listdir(folder))
                                            if read(os.path.join(folder, name)) != read("doc/" + name)])


def anchor(heading):
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def check_links():
    wrong = []
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", read(page))):
            if "://" in target:
                continue
            path, _, part = target.partition("#")
            path = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
            if not os.path.exists(path):
                wrong.append(f"{page}: {target} leads nowhere")
            elif part and part not in [anchor(h) for h in re.findall(r"^#+ (.*)$", read(path), re.M)]:
                wrong.append(f"{page}: {target}: no such heading")
    verdict("links_lead_somewhere", wrong)


def check_files():
    wrong = []
    for page in PAGES:
        for name in re.findall(r"`((?:data|src|doc|tools|include|test|drivers)/[\w./-]+)`", read(page)):
            if page != "CHANGELOG.md" and not os.path.exists(name):
                wrong.append(f"{page}: {name} is not there")
    verdict("named_files_exist", wrong)


def check_targets():
    made = set(re.findall(r"^([\w-]+):", read("Makefile"), re.M))
    wrong = [f"{page}: make {name}: no such target" for page in PAGES for name in re.findall(r"(?:`|^    )make ([a-z][\w-]+)(?![\w/-])", read(page), re.M)
             if name not in made]
    verdict("named_targets_exist", wrong)


def source():
    """All text that a person may meet, with C's literals joined as the compiler joins them."""
    text = ""
    for folder in ("src", "drivers", "tools"):
        for path in glob.glob(folder + "/**/*", recursive=True):
            if os.path.isfile(path) and not path.endswith((".png", ".pyc")):
                text += read(path)
    return re.sub(r'"\s*\n\s*"', "", text).replace('\\"', '"')


def check_messages():
    said, wrong, count = source(), [], 0
    for line in read("doc/troubleshooting.md").splitlines():
        if not line.startswith("| `"):
            continue
        for message in re.findall(r"`([^`]+)`", line.split(" | ")[0]):
            count += 1
            wrong += [f"doc/troubleshooting.md: \"{part}\" is said nowhere" for part in message.split("...") if len(part.strip(" ;:.()")) > 2 and part not in said]
    verdict("every_message_is_one_of_the_source", wrong if count > 30 else [f"only {count} messages were found"])


def check_width():
    verdict("readme_and_pages_for_reading_keep_to_120_columns",
            [f"{page}:{n}: {len(line)} columns" for page in ("README.md", "CHANGELOG.md", "doc/README.md", "doc/first-hour.md", "doc/scripts.md", "doc/tuning.md", "doc/report.md")
             for n, line in enumerate(read(page).splitlines(), 1) if len(line) > 120 and not (line.startswith("|") and page != "README.md")])


def main():
    check_made()
    check_links()
    check_files()
    check_targets()
    check_messages()
    check_width()


main()
sys.exit(failed)
