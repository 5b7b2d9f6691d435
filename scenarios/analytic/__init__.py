"""Cases with known answers, one file each: `CASE` holds scenario, reference and error measure."""
