#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    kinoise_fuzz::table(data);
});
