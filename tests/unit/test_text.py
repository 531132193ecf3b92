"""Text files in the encodings that editors, spreadsheets and instruments write."""

import pytest

from pgfmd.files.text import read_numbers, read_text

TEXT = 'title = "Stempel"  # 3 µm, 20 °C\n[drive]\n'


@pytest.mark.parametrize("coding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "cp1252", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_text_reads_the_same_in_every_encoding_and_with_every_end_of_line(tmp_path, coding, end):
    path = tmp_path / "file"
    path.write_bytes(TEXT.replace("\n", end).encode(coding))
    assert read_text(path) == TEXT


def test_the_byte_order_of_utf_16_is_the_files(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"\xfe\xff" + TEXT.encode("utf-16-be"))
    assert read_text(path) == TEXT


@pytest.mark.parametrize("raw", [b"\x93NUMPY\x01\x00\x81", b"a\0b", b"\xff\xfe\x00"])
def test_what_is_no_text_is_refused(tmp_path, raw):
    path = tmp_path / "file"
    path.write_bytes(raw)
    with pytest.raises(ValueError, match="not a text file"):
        read_text(path)


def test_an_empty_file_is_an_empty_text(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"")
    assert read_text(path) == ""


def test_a_table_has_comments_in_any_encoding_and_must_hold_numbers(tmp_path):
    path = tmp_path / "table.txt"
    path.write_bytes("# Höhe in m\r\n1e-7 2e-7 # µ\r\n\r\n3e-7 4e-7\r\n".encode("cp1252"))
    assert read_numbers(path).tolist() == [[1e-7, 2e-7], [3e-7, 4e-7]]
    path.write_bytes("1,2\n".encode("utf-16"))
    assert read_numbers(path, ",").tolist() == [[1.0, 2.0]]
    path.write_text("# only a comment\n\n")
    with pytest.raises(ValueError, match="holds no numbers"):
        read_numbers(path)
