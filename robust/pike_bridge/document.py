"""Plans with choices as files, `.tpnu.json`: read and written without loss.

Numbers are JSON numbers or strings such as "1/3", and exact either way: 0.001 is one thousandth. A `null` bound is no
bound, a missing guard is always true, and the paths of domain and problem are relative to the file. What a file may
look like is said by `tpnu.schema.json`; whether it makes sense is for :mod:`robust.pike_bridge.validate` to say.
"""

from robust.pike_bridge.document_reader import FORMAT, SCHEMA_FILE, TpnuDocument, parse_tpnu, read_tpnu
from robust.pike_bridge.document_writer import tpnu_text, write_tpnu

__all__ = ["FORMAT", "SCHEMA_FILE", "TpnuDocument", "parse_tpnu", "read_tpnu", "tpnu_text", "write_tpnu"]
