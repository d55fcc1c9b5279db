"""What users of other CANopen stacks complain of, each with the tests that answer it here."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
ANSWERS = {
    "a lost node takes the manager out of operation (CANopenNode#374)": (
        "test_node_that_is_pulled_is_lost_and_comes_back_while_others_keep_running",
        "test_all_127_nodes_of_a_network_run_and_one_is_lost_alone",
    ),
    "after a broken cable a node stays pre-operational (CANopenNode#26, #63)": (
        "test_node_is_back_whenever_it_is_pulled_while_it_boots", "test_nodes_are_regained_after_bus_off",
    ),
    "heap, one dictionary, PDO numbers without gaps (CANopenNode#575, #558, #309)": (
        "test_node_may_have_more_than_four_pdos_in_a_direction",
    ),
    "LSS selects a device too early (CANopenNode#647)": (
        "fastscan_selects_only_with_the_last_bit_and_the_first_part_next",
        "test_lss_scan_finds_every_device_without_a_number",
    ),
    "bus off never ends (CanOpenSTM32#128)": ("test_nodes_are_regained_after_bus_off",),
    "outputs when communication dies (CANopenNode#490, canopen#286, #543)": (
        "test_outputs_are_safe_while_the_program_is_stopped",
        "test_outputs_of_the_others_are_safe_while_a_node_is_lost",
    ),
    "time-outs are hidden, or a write is repeated (canopen#25, ros2_canopen#194, #204)": (
        "test_slow_replies_are_waited_for", "test_sdo_errors_say_what_to_do",
    ),
    "stuck on wait for device to boot (ros2_canopen#220, #370)": (
        "test_node_without_reply_costs_the_bus_a_frame_in_eight_seconds",
    ),
    "vendors' EDS files crash readers (canopen#313, CANopenEditor#69, #70, #23)": (
        "test_each_doubt_has_its_line_and_says_what_is_assumed", "test_an_empty_vendor_number_is_a_warning",
    ),
    "wrong event timers at some values (embedded-office#80)": ("every_event_time_is_kept",),
    "locks up after the master restarts (canfestival-rtt#23, #25)": ("the_master_may_be_restarted_a_thousand_times",),
    "configuration errors are swallowed (ros2_canopen#36, ros_canopen#425)": (
        "test_refused_write_is_named_and_tried_again",
        "test_each_value_is_written_before_the_pdos_and_these_in_the_order_that_devices_want",
    ),
    "synchronous values are lost between SYNCs (CANopenNode#23)": (
        "test_synchronous_values_are_of_one_sync", "test_values_of_all_nodes_pass_within_two_periods_of_sync",
        "test_eight_nodes_exchange_their_values_at_each_sync",
    ),
    "a request right after a block upload is dropped (CANopenNode#39)": (
        "a_request_right_after_a_block_upload_is_served",
    ),
    "an early acknowledgement is mishandled (CANopenNode#426)": (
        "an_acknowledgement_before_the_end_of_a_block_makes_no_wrong_data",
    ),
    "an LSS scan takes minutes (CANopenNode#597)": ("test_lss_scan_of_five_devices_takes_seconds",),
    "TPDOs leave 0 to 1 ms after SYNC at random (CanOpenSTM32#97)": (
        "test_synchronous_values_keep_their_sync_during_a_block_transfer",
        "test_outputs_of_a_task_that_runs_by_sync_leave_after_it",
    ),
    "two TPDOs only (CanOpenSTM32#23, c-open#34)": ("test_node_may_have_more_than_four_pdos_in_a_direction",),
    "no objects of single bits in PDOs (embedded-office#110)": ("test_values_go_both_ways",),
    "the size of objects is fixed (embedded-office#160)": ("every_size_is_transferred_in_segments",),
    "a time-out fires early (canfestival-rtt#3)": ("test_silent_node_is_a_time_out_and_blocks_nothing",),
    "block transfer is slower than segments (node-canopen#50)": ("blocks_are_faster_than_segments",),
}  # fmt: skip


@cache
def all_tests() -> str:
    files = [*TESTS.glob("c/test_canopen*.c"), *TESTS.glob("sim/test_c*.py"), *TESTS.glob("canopen/test_*.py")]
    return "\n".join(path.read_text() for path in files if path != Path(__file__))


@pytest.mark.parametrize(("complaint", "tests"), ANSWERS.items(), ids=str)
def test_each_complaint_has_its_tests(complaint: str, tests: tuple[str, ...]) -> None:
    assert complaint
    for name in tests:
        assert f"def {name}(" in all_tests() or f"RUN({name})" in all_tests(), name
