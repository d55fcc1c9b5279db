"""The unit tests of a program (TEST ... END_TEST): they run in this process, each from a cold start."""

from plctool.st_tests.report import Report, junit_xml, report_text
from plctool.st_tests.run import run_tests

__all__ = ["Report", "junit_xml", "report_text", "run_tests"]
