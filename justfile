# The commands of this project, for people and for CI; CONTRIBUTING.md gives them without `just`.

python := env_var_or_default("PYTHON", ".venv/bin/python")

# list the commands
default:
    @just --list

# make .venv with the locked versions of everything
install:
    python3 -m venv .venv
    {{python}} -m pip install --no-compile --require-hashes -r constraints.txt -r constraints-docs.txt
    {{python}} -m pip install --no-deps --no-build-isolation -e .

# format the code
format:
    {{python}} -m ruff format .
    {{python}} -m ruff check --fix .

# lint, and check the format
lint:
    {{python}} -m ruff check .
    {{python}} -m ruff format --check .

# type-check
types:
    {{python}} -m mypy

# the quick tests
test *arguments:
    {{python}} -m pytest -n auto --dist worksteal {{arguments}}

# all tests, the exhaustive ones too
test-all *arguments:
    {{python}} -m pytest -n auto --dist worksteal -m 'slow or not slow' {{arguments}}

# how many small changes to the code the quick tests notice (an hour)
mutants *arguments:
    {{python}} -m pip install -e '.[dev,mutants]'
    {{python}} -m tests.mutants {{arguments}}

# the scaling study
bench:
    {{python}} -m robust bench scaling

# the documentation as HTML in build/docs
docs:
    {{python}} -m sphinx -W -c docs -b html . build/docs

# the pictures of the documentation, also that of a page, for which chromium, chromedriver and selenium are needed
pictures:
    {{python}} -m tests.draw.pictures

# links of the documentation to other places
links:
    {{python}} -m sphinx -W -c docs -b linkcheck . build/links

# the verified checker: proofs, and robust-kernel, which goes into PREFIX/bin (Coq 8.16)
kernel PREFIX="build":
    make -C proofs/kernel install PREFIX="$(realpath -m {{PREFIX}})"

# what CI runs, in an environment of its own
ci:
    .ci/run
