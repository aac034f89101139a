//! Drawing and pages. Computes nothing: a number in a report exists as data elsewhere.
