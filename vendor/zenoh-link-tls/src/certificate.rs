//
// Copyright (c) 2026 the developers of CARS
//
// This program and the accompanying materials are made available under the
// terms of the Eclipse Public License 2.0 which is available at
// http://www.eclipse.org/legal/epl-2.0, or the Apache License, Version 2.0
// which is available at https://www.apache.org/licenses/LICENSE-2.0.
//
// SPDX-License-Identifier: EPL-2.0 OR Apache-2.0
//
//! The two things that a link wants to know of a certificate (RFC 5280), which the handshake has checked: the name of its subject
//! and how long it is valid. They are read here, because a parser of everything that a certificate can have is 15 more packages.

use time::{Date, Month, OffsetDateTime, Time};
use zenoh_result::{zerror, ZResult};

const INTEGER: u8 = 0x02;
const OBJECT_IDENTIFIER: u8 = 0x06;
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;
const SEQUENCE: u8 = 0x30;
const SET: u8 = 0x31;
/// The version of a certificate; one of version 1 has none.
const VERSION: u8 = 0xa0;
/// `UTF8String`, `NumericString`, `PrintableString`, `IA5String`.
const TEXTS: [u8; 4] = [0x0c, 0x12, 0x13, 0x16];
/// 2.5.4.3, `id-at-commonName`.
const COMMON_NAME: [u8; 3] = [0x55, 0x04, 0x03];

/// What is left to read of values in DER.
#[derive(Clone, Copy)]
struct Der<'a>(&'a [u8]);

impl<'a> Der<'a> {
    /// The tag and the content of the next value.
    fn next(&mut self) -> Option<(u8, &'a [u8])> {
        let [tag, length, rest @ ..] = self.0 else {
            return None;
        };
        // A length of 128 and more is in as many bytes as the lower bits say.
        let bytes = if length & 0x80 == 0 {
            0
        } else {
            usize::from(length & 0x7f)
        };
        if *length == 0x80 || bytes > 4 || tag & 0x1f == 0x1f {
            return None;
        }
        let (long, rest) = rest.split_at_checked(bytes)?;
        let length = if bytes == 0 {
            usize::from(*length)
        } else {
            long.iter()
                .fold(0, |length, byte| length << 8 | usize::from(*byte))
        };

        let (content, rest) = rest.split_at_checked(length)?;
        self.0 = rest;
        Some((*tag, content))
    }

    /// The content of the next value, which has this tag.
    fn expect(&mut self, tag: u8) -> Option<Der<'a>> {
        let (found, content) = self.next()?;
        (found == tag).then_some(Der(content))
    }
}

/// The validity and the subject of a certificate.
fn validity_and_subject(certificate: &[u8]) -> Option<(Der<'_>, Der<'_>)> {
    let mut signed = Der(certificate).expect(SEQUENCE)?.expect(SEQUENCE)?;
    if signed.0.first() == Some(&VERSION) {
        signed.next()?;
    }
    signed.expect(INTEGER)?;
    let _signature = signed.expect(SEQUENCE)?;
    let _issuer = signed.expect(SEQUENCE)?;
    let validity = signed.expect(SEQUENCE)?;
    let subject = signed.expect(SEQUENCE)?;
    Some((validity, subject))
}

/// The first common name of the subject of a certificate, unless it is no text.
pub(crate) fn common_name(certificate: &[u8]) -> ZResult<Option<String>> {
    let malformed = || zerror!("the subject of a certificate cannot be read");
    let (_, mut subject) = validity_and_subject(certificate).ok_or_else(malformed)?;
    while !subject.0.is_empty() {
        let mut names = subject.expect(SET).ok_or_else(malformed)?;
        while !names.0.is_empty() {
            let mut name = names.expect(SEQUENCE).ok_or_else(malformed)?;
            let kind = name.expect(OBJECT_IDENTIFIER).ok_or_else(malformed)?;
            let (tag, content) = name.next().ok_or_else(malformed)?;
            if kind.0 == COMMON_NAME {
                let text = std::str::from_utf8(content).ok();
                let text = text.filter(|_| TEXTS.contains(&tag));
                return Ok(text.map(str::to_owned));
            }
        }
    }

    Ok(None)
}

/// When a certificate ceases to be valid.
pub(crate) fn not_after(certificate: &[u8]) -> ZResult<OffsetDateTime> {
    let end = || {
        let (mut validity, _) = validity_and_subject(certificate)?;
        validity.next()?;
        let (tag, text) = validity.next()?;
        date_time(tag, text)
    };
    end().ok_or_else(|| zerror!("the validity of a certificate cannot be read").into())
}

/// A time to the second, in UTC: `YYMMDDHHMMSSZ` of the years 1950 to 2049, or `YYYYMMDDHHMMSSZ`.
fn date_time(tag: u8, text: &[u8]) -> Option<OffsetDateTime> {
    let digits = text.strip_suffix(b"Z")?;
    if !digits.is_ascii() || digits.len() % 2 == 1 {
        return None;
    }
    let mut pairs = Vec::new();
    for pair in digits.chunks(2) {
        let is_number = pair.iter().all(u8::is_ascii_digit);
        pairs.push(is_number.then(|| 10 * (pair[0] - b'0') + pair[1] - b'0')?);
    }

    let (year, rest) = match (tag, &pairs[..]) {
        (UTC_TIME, [year @ 50..=99, rest @ ..]) => (1900 + i32::from(*year), rest),
        (UTC_TIME, [year, rest @ ..]) => (2000 + i32::from(*year), rest),
        (GENERALIZED_TIME, [century, year, rest @ ..]) => {
            (100 * i32::from(*century) + i32::from(*year), rest)
        }
        _ => return None,
    };
    let [month, day, hour, minute, second] = *rest else {
        return None;
    };
    let date = Date::from_calendar_date(year, Month::try_from(month).ok()?, day).ok()?;
    let time = Time::from_hms(hour, minute, second).ok()?;
    Some(date.with_time(time).assume_utc())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A value in DER.
    fn der(tag: u8, content: &[u8]) -> Vec<u8> {
        let length = content.len();
        let head = match length {
            0..128 => vec![tag, length as u8],
            _ => vec![tag, 0x82, (length >> 8) as u8, length as u8],
        };
        [head, content.to_vec()].concat()
    }

    fn attribute(kind: &[u8], tag: u8, text: &[u8]) -> Vec<u8> {
        let pair = [der(OBJECT_IDENTIFIER, kind), der(tag, text)].concat();
        der(SET, &der(SEQUENCE, &pair))
    }

    /// A certificate with this subject, valid until the given time.
    fn certificate(subject: &[Vec<u8>], end: &[u8]) -> Vec<u8> {
        let validity = [der(UTC_TIME, b"260101000000Z"), end.to_vec()].concat();
        let signed = [
            der(VERSION, &der(INTEGER, &[2])),
            der(INTEGER, &[1; 20]),
            der(SEQUENCE, &[]),
            der(SEQUENCE, &attribute(&COMMON_NAME, TEXTS[0], b"issuer")),
            der(SEQUENCE, &validity),
            der(SEQUENCE, &subject.concat()),
            der(SEQUENCE, &[0; 300]),
        ];
        der(SEQUENCE, &der(SEQUENCE, &signed.concat()))
    }

    fn end() -> Vec<u8> {
        der(UTC_TIME, b"491231235959Z")
    }

    #[test]
    fn the_first_common_name_of_the_subject_counts() {
        let organization = attribute(&[0x55, 0x04, 0x0a], TEXTS[0], b"CARS");
        let first = attribute(&COMMON_NAME, TEXTS[2], b"Butler");
        let second = attribute(&COMMON_NAME, TEXTS[0], b"Eve");
        let subject = [organization.clone(), first, second.clone()];
        let name = common_name(&certificate(&subject, &end())).unwrap();
        assert_eq!(name.as_deref(), Some("Butler"));

        let name = common_name(&certificate(&[organization], &end())).unwrap();
        assert_eq!(name, None);
        // BMPString: what is no UTF-8 is no name, and the next one is not taken for it.
        let wide = attribute(&COMMON_NAME, 0x1e, b"\0B");
        let name = common_name(&certificate(&[wide, second], &end())).unwrap();
        assert_eq!(name, None);
    }

    #[test]
    fn the_end_is_in_either_century() {
        let not_after = |tag, text: &[u8]| not_after(&certificate(&[], &der(tag, text)));
        let unix = |tag, text: &[u8]| not_after(tag, text).unwrap().unix_timestamp();
        assert_eq!(unix(UTC_TIME, b"700101000001Z"), 1);
        assert_eq!(unix(UTC_TIME, b"491231235959Z"), 2_524_607_999);
        assert_eq!(unix(GENERALIZED_TIME, b"20500101000000Z"), 2_524_608_000);
        for text in [
            &b"491331235959Z"[..],
            b"4912312359Z",
            b"49123123595+Z",
            b"491231235959",
            b"Z",
        ] {
            assert!(not_after(UTC_TIME, text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn a_certificate_that_is_cut_or_damaged_is_refused_and_never_panics() {
        let subject = [attribute(&COMMON_NAME, TEXTS[0], b"Butler")];
        let whole = certificate(&subject, &end());
        for length in 0..whole.len() {
            assert!(common_name(&whole[..length]).is_err(), "{length}");
            assert!(not_after(&whole[..length]).is_err(), "{length}");
        }
        for position in 0..whole.len() {
            for byte in 0..=u8::MAX {
                let mut damaged = whole.clone();
                damaged[position] = byte;
                let _ = common_name(&damaged);
                let _ = not_after(&damaged);
            }
        }
        // A length of more than memory has.
        assert!(common_name(&[SEQUENCE, 0x88, 255, 255, 255, 255, 255, 255, 255, 255]).is_err());
    }
}
