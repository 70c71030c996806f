"""Certificates for TLS on both sides: an authority of the user's own signs the host's and those of who may come in.

The host's certificate is made anew whenever it listens, for the names and addresses that the machine has then, and stands in no
file. A client's names its user, so that the router knows his role; it is good for authenticating clients only, so nobody who was
let in can pass for the host.
"""

from __future__ import annotations

import datetime
import ipaddress
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import msgspec

from elys.common.errors import AccessError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate, CertificateBuilder

AUTHORITY_DAYS: Final = 3650.0
HOST_DAYS: Final = 397.0  # what is listened at is made anew at every start
CLIENT_DAYS: Final = 365.0
_EARLIER: Final = datetime.timedelta(minutes=10)  # clocks of two machines differ


class Authority(msgspec.Struct, kw_only=True):
    """Signs. Made when it is first needed, and kept with the keys."""

    certificate: str = ""  # PEM
    private_key: str = ""  # PEM

    def __repr__(self) -> str:
        """Without the private key."""
        return "Authority()"

    def ensure(self) -> bool:
        """Makes it unless it is there; whether it was made."""
        if self.certificate:
            return False
        private_key = _private_key()
        name = _name("ELYS authority of this user")
        usage = _key_usage(signs_certificates=True)
        builder = _builder(name, name, private_key, AUTHORITY_DAYS)
        builder = builder.add_extension(_x509().BasicConstraints(ca=True, path_length=0), critical=True)
        signed = builder.add_extension(usage, critical=True).sign(private_key, _sha256())
        self.certificate, self.private_key = _pem(signed), _pem_of_key(private_key)
        return True

    def host(self, names: Iterable[str], *, days: float = HOST_DAYS) -> tuple[str, str]:
        """A certificate, and its private key, of a host that is reached under these names and addresses; PEM both."""
        subject = _x509().SubjectAlternativeName([_general_name(name) for name in names])
        return self._sign("ELYS host", days, subject, is_host=True)

    def client(self, user: str, *, days: float = CLIENT_DAYS) -> tuple[str, str]:
        """A certificate, and its private key, of who comes in as `user`; PEM both."""
        return self._sign(user, days, None, is_host=False)

    def _sign(self, subject: str, days: float, names: Any, *, is_host: bool) -> tuple[str, str]:
        x509 = _x509()
        if not self.certificate:
            raise AccessError("there is no authority yet that could sign: `elys keys export` makes one")
        from cryptography.hazmat.primitives.serialization import load_pem_private_key

        authority = x509.load_pem_x509_certificate(self.certificate.encode())
        signing: Any = load_pem_private_key(self.private_key.encode(), password=None)
        private_key = _private_key()
        purposes = x509.oid.ExtendedKeyUsageOID
        purpose = purposes.SERVER_AUTH if is_host else purposes.CLIENT_AUTH
        builder = _builder(_name(subject), authority.subject, private_key, days)
        builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        builder = builder.add_extension(_key_usage(signs_certificates=False), critical=True)
        builder = builder.add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), critical=False
        )
        if names is not None:
            builder = builder.add_extension(names, critical=False)
        return _pem(builder.sign(signing, _sha256())), _pem_of_key(private_key)


def expiry(certificate: str) -> datetime.datetime:
    """Until when a PEM certificate is good, in UTC; AccessError for what is none."""
    try:
        until: datetime.datetime = _x509().load_pem_x509_certificate(certificate.encode()).not_valid_after_utc
        return until
    except ValueError as error:
        raise AccessError(f"what should be a certificate is none ({error})") from error


def _x509() -> Any:
    from cryptography import x509  # not at the top: most sessions need none, and it takes its time

    return x509


def _private_key() -> EllipticCurvePrivateKey:
    from cryptography.hazmat.primitives.asymmetric import ec

    return ec.generate_private_key(ec.SECP256R1())


def _sha256() -> Any:
    from cryptography.hazmat.primitives import hashes

    return hashes.SHA256()


def _name(common_name: str) -> Any:
    x509 = _x509()
    return x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, common_name)])


def _general_name(name: str) -> Any:
    x509 = _x509()
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _builder(subject: Any, issuer: Any, private_key: EllipticCurvePrivateKey, days: float) -> CertificateBuilder:
    x509 = _x509()
    now = datetime.datetime.now(datetime.UTC)
    builder: CertificateBuilder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(private_key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now, now + datetime.timedelta(days=days)) - _EARLIER)
        .not_valid_after(now + datetime.timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(private_key.public_key()), critical=False)
    )
    return builder


def _key_usage(*, signs_certificates: bool) -> Any:
    return _x509().KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _pem(certificate: Certificate) -> str:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.PEM).decode()


def _pem_of_key(private_key: EllipticCurvePrivateKey) -> str:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    return private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
