"""The unit tests of a program (TEST ... END_TEST): they run in this process, each from a cold start."""

from plctool.st_tests.report import Report, failure_text, junit_xml, report_text
from plctool.st_tests.run import TestProgram, run_chosen, run_tests, up_to_test

__all__ = ["Report", "TestProgram", "failure_text", "junit_xml", "report_text", "run_chosen", "run_tests", "up_to_test"]
